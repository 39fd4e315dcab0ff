"""Systems with internal delays: loops and sums."""
