"""Closed loops: crossings of a response, and responses from values on a circle."""
