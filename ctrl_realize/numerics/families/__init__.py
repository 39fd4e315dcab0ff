"""Families of models: what maps parameters to a dead time, poles and a shape of the response."""
