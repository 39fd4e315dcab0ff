"""Numerical kernels: arrays in, arrays out.

Nothing here knows python-control, matplotlib or files. Arguments are checked once, at the
public border of the package; kernels trust them.
"""
