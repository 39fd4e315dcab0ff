"""A model of a frequency response

A stepped sine with its standard deviation, and a model with dead time that was fitted to it.
Simulated valve.

See: ../../howto/frequency_responses, ../notebooks/06_frf_and_coherence
"""

import ctrl_realize as cr

frf = cr.read_frf(cr.datasets.path("simulated_valve", "frf"))
sys = cr.fit_frf(frf, 3)
sys.fit.plot()
