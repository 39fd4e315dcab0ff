"""Impulse responses from records of any input."""
