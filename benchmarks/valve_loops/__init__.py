"""Oscillating loops: what each method says on simulated and measured ones."""
