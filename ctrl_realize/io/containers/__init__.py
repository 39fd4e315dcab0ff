"""Files with arrays: NumPy, MATLAB, Parquet."""
