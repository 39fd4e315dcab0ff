"""Dead times from records of running loops: errors, coverage and width of intervals."""
