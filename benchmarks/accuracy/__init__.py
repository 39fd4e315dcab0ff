"""Monte Carlo of dead-time estimators against the Cramer-Rao bound; all plants simulated."""

import os

# Before numpy is loaded: several processes with several threads each would fight for the cores.
for _variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_variable, "1")
