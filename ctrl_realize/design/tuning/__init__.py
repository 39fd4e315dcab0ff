"""PID controllers: tuning rules, comparison, optimal settings."""
