"""Models for design: reduction, conversion, approximation."""
