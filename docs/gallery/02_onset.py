"""The onset of a step response

The dead time ends before any movement can be seen; the interval says how well it is known.
Simulated valve.

See: ../../howto/trust_delay, ../../theory/identifiability
"""

import ctrl_realize as cr

record = cr.read_record(cr.datasets.path("simulated_valve"))
sys = cr.identify(record)
cr.plots.onset_plot(record, sys)
