"""The engine: models with dead time, their linear parameters eliminated, fitted and profiled."""
