"""Fits of records whose input is no single step."""
