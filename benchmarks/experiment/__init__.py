"""Predicted and achieved standard errors of planned tests, on simulated plants."""
