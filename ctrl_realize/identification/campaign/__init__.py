"""Many records: table, statistics, one model of all."""
