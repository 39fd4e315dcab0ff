"""``ctrl-realize valve``."""
