"""Models fitted to time records and a frequency response together."""
