"""Files that hold arrays: NumPy, MATLAB, Parquet."""
