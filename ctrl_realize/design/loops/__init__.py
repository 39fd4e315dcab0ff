"""Open and closed loops: margins, performance, robustness."""
