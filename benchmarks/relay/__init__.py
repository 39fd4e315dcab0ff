"""Relay tests of simulated plants: ultimate point by a fit, and by the describing function."""
