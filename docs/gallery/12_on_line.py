"""A dead time that wears

Tracked sample by sample while a simulated valve ages from 37 to 47 samples; no estimate where the
data say nothing.

See: ../../howto/on_line
"""

import control as ct
import numpy as np

import ctrl_realize as cr

lag = ct.tf([12.0], [1, 12.0])
dt = 0.01
k = np.arange(4000)
u = np.repeat(np.random.default_rng(0).integers(0, 5, 40), 100).astype(float)
delay = 37 + 10 * np.clip((k - 1500) / 1000, 0, 1)
y = np.interp(k - delay, k, cr.delayed_ss(lag, delay=0, dt=dt).simulate(u), left=u[0])
y += 0.02 * np.random.default_rng(1).standard_normal(k.size)

start = cr.delayed_ss(lag, delay=37, dt=dt)
tracker = cr.DelayTracker(start, max_delay=80, forgetting_time=2.5)
tracker.track(cr.Record(k * dt, u, y)).plot()
