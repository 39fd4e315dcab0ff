"""Text tables: dialects, headers, cells."""
