"""PID rules compared

Robustness against speed for several tuning rules, on a model of a simulated heater.

See: ../../howto/tune_pid, ../notebooks/11_controllers_from_a_measured_plant
"""

import ctrl_realize as cr

sys = cr.identify(cr.bench.heater().step_record(rng=3))
cr.design.compare_pid(sys, ["simc", "amigo", "lambda", "optimal"]).plot()
