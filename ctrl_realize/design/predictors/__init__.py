"""Controllers that predict through the dead time: Smith predictor, LQR, LQG."""
