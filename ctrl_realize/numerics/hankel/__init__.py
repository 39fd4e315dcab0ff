"""Hankel matrices of Markov parameters, their singular values, and Kung's realization."""
