"""Speed and values of design functions against python-control on the augmented matrices."""

import os

# Before numpy is imported anywhere: one thread, so that ratios mean something.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")
