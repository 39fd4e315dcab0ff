"""What the structure does to the dead time

Each structure that the data allow, with its dead time. The interval spans them all. Simulated
heater.

See: ../../howto/choose_order, ../../howto/trust_delay
"""

import ctrl_realize as cr

sys = cr.identify(cr.bench.heater().step_record(rng=3))
cr.plots.dead_time_plot(sys.fit)
