"""Process parameters (gain, dead time, lags, leads) of fitted models, and their errors."""
