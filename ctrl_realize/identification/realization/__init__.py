"""Kung's realization, and the scan over delays and orders."""
