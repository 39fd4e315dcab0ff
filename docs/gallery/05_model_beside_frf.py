"""A model of a step, checked by a frequency response

The model was identified from a step alone; the frequency response was measured independently.
Simulated valve.

See: ../../howto/frequency_responses, ../notebooks/01_three_lines
"""

import ctrl_realize as cr

sys = cr.identify(cr.read_record(cr.datasets.path("simulated_valve")))
frf = cr.read_frf(cr.datasets.path("simulated_valve", "frf"))
cr.compare_frf(sys, frf).plot()
