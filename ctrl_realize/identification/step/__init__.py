"""Step records: edges, unit steps, impulse responses from steps."""
