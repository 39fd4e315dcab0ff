"""Closed loops around dead time: core and delays against augmented matrices."""
