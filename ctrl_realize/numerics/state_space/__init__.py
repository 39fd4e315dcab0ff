"""State-space models: responses, sampling, balancing, sections, dead time approximations."""
