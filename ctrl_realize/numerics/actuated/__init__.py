"""Fits of models with the nonlinearity of an actuator before or behind linear dynamics."""
