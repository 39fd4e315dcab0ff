"""Worlds that the rules of the toolbox were not made for: how often is a wrong answer silent?

All simulated. Every world is a function of a generator of random numbers with a stated physics
and a known truth; ten more are described by the model and count needless flags.
"""

import os

# Before numpy is loaded: several processes with several threads each would fight for the cores.
for _variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_variable, "1")
