"""Axial dispersion: responses of a flow that disperses, and its fit to a step record."""
