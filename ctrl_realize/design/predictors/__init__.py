"""Controllers with prediction over the dead time: Smith predictor, LQR, LQG."""
