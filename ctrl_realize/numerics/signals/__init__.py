"""Properties of a single signal: edges, noise, baseline, onset, correlation, filters."""
