"""State-space models: responses, sampling, balancing, sections, approximation of dead time."""
