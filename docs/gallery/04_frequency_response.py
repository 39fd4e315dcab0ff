"""A model of a frequency response

A stepped sine, and a model with dead time that was fitted to it; its order is chosen. Simulated
valve with 28.9 ms of dead time.

See: ../../howto/frequency_responses, ../notebooks/06_frf_and_coherence
"""

import ctrl_realize as cr

frf = cr.read_frf(cr.datasets.path("simulated_valve", "frf"))
sys = cr.fit_frf(frf)
sys.fit.plot()
