"""Fits of actuators: errors, intervals, needless actuators, and dead times behind them."""
