"""A measured heater

Measured data of a Temperature Control Lab, several steps: record, model and residual.

See: ../../tutorial, ../../datasets
"""

import ctrl_realize as cr

record = cr.datasets.load("tclab").records[0]
sys = cr.identify(record)
sys.fit.plot()
