"""Closed loops: crossings of a response, and circles around points of it."""
