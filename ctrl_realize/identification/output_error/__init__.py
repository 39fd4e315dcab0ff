"""Output-error fits of records: entry points, flags and results."""
