"""From the columns of a file to the signals of records."""
