"""Rational models with dead time of measured frequency responses."""
