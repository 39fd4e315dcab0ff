"""Oscillation of control loops: detection, shape, phase, higher-order statistics."""
