"""Do intervals cover, do flags speak up? Coverage, false alarms and misses; all simulated."""

import os

# Before numpy is loaded: several processes with several threads each would fight for the cores.
for _variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_variable, "1")
