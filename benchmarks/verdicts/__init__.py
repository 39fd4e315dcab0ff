"""How often each verdict of a fit is right, on simulated plants whose truth is known."""
