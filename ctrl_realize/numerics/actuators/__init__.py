"""What actuators do that no linear model says: arrays in, arrays out."""
