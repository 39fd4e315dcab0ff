"""Plots of control valves."""
