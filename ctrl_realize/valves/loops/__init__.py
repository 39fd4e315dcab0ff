"""Whether the valve makes a control loop oscillate, from operating data."""
