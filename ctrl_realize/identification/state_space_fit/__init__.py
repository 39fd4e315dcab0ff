"""Fits of general state-space models with delays."""
