"""Dead time tracked on line."""
