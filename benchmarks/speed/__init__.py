"""How fast the toolbox is, as ratios against named baselines in the same run.

``python -m benchmarks.speed`` prints the table and writes it for the docs.
One BLAS thread: pinned here, before anything imports NumPy.
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"
