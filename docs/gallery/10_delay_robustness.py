"""Prediction and a wrong dead time

How far the dead time may be off before a Smith predictor becomes unstable, beside the interval of
the data.

See: ../../howto/closed_loop, ../notebooks/07_controllers
"""

import ctrl_realize as cr

sys = cr.identify(cr.bench.heater().step_record(rng=3))
controller = cr.design.pid(cr.delayed_ss(sys.delay_free, 0), closed_loop_time=15)
predictor = cr.design.smith_predictor(sys, controller)
cr.design.delay_robustness(sys, predictor, sys.fit.interval).plot()
