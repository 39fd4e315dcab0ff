"""Systems whose delays stand inside: in loops and sums."""
