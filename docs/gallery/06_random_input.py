"""Random binary input, and what is left

Residual of a flow loop under a random binary input: independent of the input, and not quite
white, since the flow is disturbed. Simulated.

See: ../../howto/random_inputs, ../../howto/other_inputs
"""

import numpy as np

import ctrl_realize as cr

bits = np.random.default_rng(0).integers(0, 2, 60)
record = cr.bench.flow_loop().record(45 + 10 * np.repeat(bits, 20), rng=1)
sys = cr.identify(record)
cr.validation.analyse_residuals(sys, record).plot()
