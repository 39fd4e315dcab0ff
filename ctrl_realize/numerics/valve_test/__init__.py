"""Times of a step response and static curves of a valve, with standard errors."""
