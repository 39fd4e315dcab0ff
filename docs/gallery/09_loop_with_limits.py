"""A loop with its actuator

Set-point and load responses with the heater's limits and the sensor's noise; output of the
controller below. Simulated.

See: ../../howto/tune_pid, ../../howto/closed_loop
"""

import ctrl_realize as cr

sys = cr.identify(cr.bench.heater().step_record(rng=3))
heater = {"output_limits": (0, 100), "bias": 20}
loops = {
    "PI": cr.design.pid(sys, "simc", "PI").algorithm(**heater),
    "PID": cr.design.pid(sys, "simc", "PID").algorithm(**heater),
}
cr.plots.closed_loop_plot(sys, loops, setpoint_step=20, load_step=5, noise_std=0.05)
