"""Every parameter of six plants with dead time, in open and in closed loop, beside its bound."""
