"""A campaign of steps

Steps of two heights, each identified by itself; the intervals beside the true delay. Simulated
valve.

See: ../../howto/several_records, ../notebooks/05_forty_records
"""

import ctrl_realize as cr

valve = cr.bench.valve(lvdt_hz=None, noise=5e-3)
records = valve.step_campaign(rng=1, amplitudes=(16, 8), repeats=4)
cr.identify_campaign(records).plot(truth=37)
