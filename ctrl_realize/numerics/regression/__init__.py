"""Linear regression: ARX, regularised FIR models, recursive least squares."""
