"""Tuning rules: parameters of an ideal PID from a process model.

Each function returns (kp, ti, td); ti is inf without an integral, td is 0 without a derivative.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from ...errors import OptionError, UnsuitableSystemError
from ..models.process_model import ProcessModel

Parameters = tuple[float, float, float]
Rule = Callable[[ProcessModel, str, float | None], Parameters]
INF = float("inf")


def simc(model: ProcessModel, kind: str, closed_loop_time: float | None) -> Parameters:
    """Skogestad (2003), sections 3-4; the closed-loop time defaults to the dead time.

    The derivative cancels the second lag; without one the PID is the PI.
    """
    theta = model.dead_time
    tau_c = theta if closed_loop_time is None else closed_loop_time
    if tau_c + theta == 0:
        raise OptionError("the model has no dead time; give closed_loop_time in s")
    if model.integrating:
        kp, ti, second = 1 / (model.gain * (tau_c + theta)), 4 * (tau_c + theta), model.lag
    else:
        kp = model.lag / (model.gain * (tau_c + theta))
        ti, second = min(model.lag, 4 * (tau_c + theta)), model.second_lag
    if "D" not in kind:
        return kp, ti if "I" in kind else INF, 0.0
    if "I" in kind:
        # The rule is for the series form; this is the equivalent ideal form.
        factor = 1 + second / ti
        return kp * factor, ti * factor, second / factor
    if second == 0:
        raise OptionError(
            "simc has a derivative only for models with a second lag; use kind='P', or a model "
            "from reduce_sopdt"
        )
    return kp, INF, second


def lambda_(model: ProcessModel, kind: str, closed_loop_time: float | None) -> Parameters:
    """Lambda tuning: cancel the lag; closed-loop time by default max(lag, 3 dead times).

    Dahlin (1968); for integrating models after Chien and Fruehauf (1990).
    """
    theta = model.dead_time
    fallback = 3 * theta if model.integrating else max(model.lag, 3 * theta)
    target = fallback if closed_loop_time is None else closed_loop_time
    if model.integrating:
        ti = 2 * target + theta
        return ti / (model.gain * (target + theta) ** 2), ti, 0.0
    return model.lag / (model.gain * (target + theta)), model.lag, 0.0


def imc(model: ProcessModel, kind: str, closed_loop_time: float | None) -> Parameters:
    """Internal model control: Rivera, Morari and Skogestad (1986), table II.

    The improved PI is used; the closed-loop time defaults to 1.7 (PI) or 0.8 (PID) dead times, the
    smallest values that they allow.
    """
    _needs_lag(model, "imc")
    theta, tau = model.dead_time, model.lag
    fallback = (0.8 if kind == "PID" else 1.7) * theta
    target = max(fallback, 0.1 * tau) if closed_loop_time is None else closed_loop_time
    ti = tau + theta / 2
    if kind == "PI":
        return ti / (model.gain * target), ti, 0.0
    return ti / (model.gain * (target + theta / 2)), ti, tau * theta / (2 * ti)


def amigo(model: ProcessModel, kind: str, closed_loop_time: float | None) -> Parameters:
    """Astrom and Hagglund, Advanced PID Control (2006), chapter 7: Ms near 1.4."""
    L, K = _dead_time(model, "amigo"), model.gain
    if model.integrating:
        if kind == "PI":
            return 0.35 / (K * L), 13.4 * L, 0.0
        return 0.45 / (K * L), 8 * L, 0.5 * L
    T = model.lag
    if kind == "PI":
        kp = 0.15 / K + (0.35 - L * T / (L + T) ** 2) * T / (K * L)
        return kp, 0.35 * L + 13 * L * T**2 / (T**2 + 12 * L * T + 7 * L**2), 0.0
    kp = (0.2 + 0.45 * T / L) / K
    return kp, (0.4 * L + 0.8 * T) / (L + 0.1 * T) * L, 0.5 * L * T / (0.3 * L + T)


def ziegler_nichols(model: ProcessModel, kind: str, closed_loop_time: float | None) -> Parameters:
    """Ziegler and Nichols (1942), from the step response: quarter-amplitude damping."""
    L = _dead_time(model, "ziegler_nichols")
    a = model.gain * L if model.integrating else model.gain * L / model.lag
    rows = {"P": (1 / a, INF, 0.0), "PI": (0.9 / a, L / 0.3, 0.0), "PID": (1.2 / a, 2 * L, L / 2)}
    return rows[kind]


def cohen_coon(model: ProcessModel, kind: str, closed_loop_time: float | None) -> Parameters:
    """Cohen and Coon (1953): quarter-amplitude damping, with the decay of the lag."""
    _needs_lag(model, "cohen_coon")
    L = _dead_time(model, "cohen_coon")
    r, a = L / model.lag, model.gain * L / model.lag
    if kind == "PD" and r >= 3:
        raise UnsuitableSystemError(
            f"rule 'cohen_coon' has a PD for dead times below 3 lags; this model has {r:.3g}. Use "
            "P, PI or PID, or rule='optimal'"
        )
    return {
        "P": ((1 + r / 3) / a, INF, 0.0),
        "PI": ((0.9 + r / 12) / a, L * (30 + 3 * r) / (9 + 20 * r), 0.0),
        "PD": ((1.25 + r / 6) / a, INF, L * (6 - 2 * r) / (22 + 3 * r)),
        "PID": ((4 / 3 + r / 4) / a, L * (32 + 6 * r) / (13 + 8 * r), 4 * L / (11 + 2 * r)),
    }[kind]


CHR_RULES: dict[str, dict[str, Parameters]] = {
    "chr_setpoint_0": {"P": (0.3, INF, 0), "PI": (0.35, 1.2, 0), "PID": (0.6, 1, 0.5)},
    "chr_setpoint_20": {"P": (0.7, INF, 0), "PI": (0.6, 1, 0), "PID": (0.95, 1.4, 0.47)},
    "chr_load_0": {"P": (0.3, INF, 0), "PI": (0.6, 4, 0), "PID": (0.95, 2.4, 0.42)},
    "chr_load_20": {"P": (0.7, INF, 0), "PI": (0.7, 2.3, 0), "PID": (1.2, 2, 0.42)},
}
"""Factors of 1 / a (kp), of the lag or, for a load, the dead time (ti), and the dead time (td)."""


def _chr(rule: str, model: ProcessModel, kind: str, closed_loop_time: float | None) -> Parameters:
    """Chien, Hrones and Reswick (1952): fastest response to set-point or load, 0 or 20 % over."""
    _needs_lag(model, rule)
    L, (kp, ti, td) = _dead_time(model, rule), CHR_RULES[rule][kind]
    return kp * model.lag / (model.gain * L), ti * (L if "load" in rule else model.lag), td * L


def itae_load(model: ProcessModel, kind: str, closed_loop_time: float | None) -> Parameters:
    """Lopez, Miller, Smith and Murrill (1967): least ITAE after a step of a load."""
    r, T, K = _itae_ratio(model, "itae_load"), model.lag, model.gain
    if kind == "PI":
        return 0.859 * r**-0.977 / K, T / 0.674 * r**0.680, 0.0
    return 1.357 * r**-0.947 / K, T / 0.842 * r**0.738, 0.381 * T * r**0.995


def itae_setpoint(model: ProcessModel, kind: str, closed_loop_time: float | None) -> Parameters:
    """Rovira, Murrill and Smith (1969): least ITAE after a step of the set-point."""
    r, T, K = _itae_ratio(model, "itae_setpoint"), model.lag, model.gain
    if kind == "PI":
        return 0.586 * r**-0.916 / K, T / (1.03 - 0.165 * r), 0.0
    return 0.965 * r**-0.85 / K, T / (0.796 - 0.1465 * r), 0.308 * T * r**0.929


def _itae_ratio(model: ProcessModel, rule: str) -> float:
    """Ratio of dead time and lag, which these rules were fitted to between 0.1 and 1."""
    _needs_lag(model, rule)
    ratio = model.dead_time / model.lag
    if not 0.1 <= ratio <= 1:
        raise UnsuitableSystemError(
            f"the itae rules are for dead times of 0.1 to 1 lags, the model has {ratio:.3g}; use "
            "'simc', 'lambda', 'amigo' or 'optimal'"
        )
    return ratio


def from_ultimate(rule: str, kind: str, gain: float, period: float) -> Parameters:
    """Parameters from the gain and period of sustained oscillation."""
    kp, ti, td = ULTIMATE_RULES[rule][kind]
    return kp * gain, ti * period, td * period


def _dead_time(model: ProcessModel, rule: str) -> float:
    if model.dead_time <= 0:
        raise OptionError(f"rule={rule!r} divides by the dead time, but the model has none")
    return model.dead_time


def _needs_lag(model: ProcessModel, rule: str) -> None:
    if model.integrating:
        raise UnsuitableSystemError(
            f"rule={rule!r} is for models with a lag, not for integrating models; use 'simc', "
            "'lambda', 'amigo' or 'optimal'"
        )


MODEL_RULES: dict[str, tuple[Rule, tuple[str, ...]]] = {
    "simc": (simc, ("P", "PI", "PD", "PID")),
    "lambda": (lambda_, ("PI",)),
    "imc": (imc, ("PI", "PID")),
    "amigo": (amigo, ("PI", "PID")),
    "ziegler_nichols": (ziegler_nichols, ("P", "PI", "PID")),
    "cohen_coon": (cohen_coon, ("P", "PI", "PD", "PID")),
    **{rule: (partial(_chr, rule), tuple(rows)) for rule, rows in CHR_RULES.items()},
    "itae_setpoint": (itae_setpoint, ("PI", "PID")),
    "itae_load": (itae_load, ("PI", "PID")),
}
"""Rules that use a process model, and the kinds that they offer."""

ULTIMATE_RULES: dict[str, dict[str, Parameters]] = {
    "ziegler_nichols_ultimate": {
        "P": (0.5, INF, 0.0),
        "PI": (0.45, 1 / 1.2, 0.0),
        "PID": (0.6, 0.5, 0.125),
    },
    "tyreus_luyben": {"PI": (1 / 3.2, 2.2, 0.0), "PID": (1 / 2.2, 2.2, 1 / 6.3)},
}
"""Factors of the ultimate gain (kp) and period (ti, td): Ziegler and Nichols (1942); Tyreus and
Luyben (1992), whose PID is that of Luyben and Luyben (1997)."""

SYSTEM_RULES: dict[str, tuple[str, ...]] = {
    **{rule: tuple(kinds) for rule, kinds in ULTIMATE_RULES.items()},
    "optimal": ("P", "PI", "PD", "PID"),
}
"""Rules that use the frequency response of the plant itself, and the kinds that they offer."""


def kinds_of(rule: str) -> tuple[str, ...]:
    """Return the kinds of controller that a rule offers."""
    return MODEL_RULES[rule][1] if rule in MODEL_RULES else SYSTEM_RULES[rule]
