"""Separable least squares for models with dead time."""
