"""Models made for design: reduction, conversion, approximation."""
