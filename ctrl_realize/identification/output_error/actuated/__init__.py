"""Models with the nonlinearity of an actuator, beside the linear fit of the same records."""
