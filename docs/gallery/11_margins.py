"""Margins at a long dead time

Nyquist curve and margins, exact however long the dead time is: no Padé approximation.

See: ../../howto/dead_time, ../../howto/closed_loop
"""

import control as ct

import ctrl_realize as cr

plant = cr.delayed_ss(ct.tf([1.0], [1, 1]), dead_time=3.0, dt=0.05)
pi = cr.design.pid(plant, "simc", "PI")
cr.design.margins(plant, pi).plot()
