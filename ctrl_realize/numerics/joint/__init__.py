"""One model of time records and a frequency response together."""
