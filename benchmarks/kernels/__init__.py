"""Whether what is found depends on the processor, on rounding, or on the units of a record."""
