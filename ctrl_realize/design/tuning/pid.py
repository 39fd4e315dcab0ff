"""PID controllers by tuning rules."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, fields, replace
from typing import Any, Literal

import numpy as np

from ..._checks import one_of, positive, within
from ...data.shown_units import in_shown_units
from ...errors import OptionError
from ...numerics.blas_threads import single_threaded
from ..loops.loop_check import MOST_SENSITIVE, loop_check, refuse_unstable, warn_of
from ..models.process_model import ProcessModel
from ..models.reduction import METHODS as REDUCTIONS
from .algorithm import DISCRETIZATIONS
from .controller import PIDController
from .optimal import optimal
from .plant import TuningPlant, gain_and_time_units, turned_feedthrough
from .rules import MODEL_RULES, SYSTEM_RULES, from_ultimate, kinds_of
from .ultimate import critical_point

RULES = (*MODEL_RULES, *SYSTEM_RULES)
KINDS = ("P", "PI", "PD", "PID")
_CHOICES = {"rule": RULES, "kind": KINDS, "reduction": REDUCTIONS, "method": DISCRETIZATIONS}
_USUAL_MS = 1.4  # of the optimal rule
SAFE = ("amigo", "simc", "lambda")
"""Rules that are suggested if the loop of another is unstable; then the optimal PI."""
ADJUSTED = ("simc", "lambda", "imc")
"""Rules with a closed-loop time."""
LONGER = (1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0, 24.0)
"""Closed-loop times that are tried for a robust loop, in dead times."""


@single_threaded
@in_shown_units
def pid(
    system: Any,
    rule: str = "simc",
    kind: str = "PI",
    *,
    closed_loop_time: float | Literal["robust"] | None = None,
    max_sensitivity: float | None = None,
    derivative_filter: float = 10.0,
    reduction: str = "optimal",
    method: str = "tustin",
    dt: float | None = None,
    name: str | None = None,
) -> PIDController:
    """Tune a P, PI, PD or PID controller.

    Parameters
    ----------
    system : DelayedStateSpace, DelaySystem or ProcessModel
        Plant with one input and one output. For a discrete system the controller is discrete with
        its sample time; the rules then use half a sample more dead time, for the hold. For a
        process model or a continuous system, with its dead time at input or output, the controller
        is continuous unless `dt` is given.
    rule : str, optional
        ``"simc"``, ``"lambda"``, ``"imc"``, ``"amigo"``, ``"ziegler_nichols"``, ``"cohen_coon"``,
        ``"chr_*"`` (``"chr_setpoint_0"``, ``"chr_load_20"``, ...: Chien, Hrones and Reswick for
        moves of the set-point or loads, with 0 or 20 % of overshoot), ``"itae_setpoint"`` and
        ``"itae_load"`` use a reduced model; ``"ziegler_nichols_ultimate"`` and
        ``"tyreus_luyben"`` the exact ultimate gain, see `ultimate`; ``"optimal"`` minimizes the
        integrated absolute error after a load step subject to `max_sensitivity`.
    kind : {"P", "PI", "PD", "PID"}, optional
        Not every rule exists for every kind. The PID of simc is a PI for a plant with one lag.
    closed_loop_time : float or "robust", optional
        In s, for simc, lambda and imc. ``"robust"``: the shortest, from the default of simc up to
        24 times it, with Ms of at most 2 on the model and on all models that its data do not rule
        out; if there is none, that of the smallest Ms, with a warning.
    max_sensitivity : float, optional
        Ms, for the optimal rule; default: 1.4.
    derivative_filter : float, optional
        td / tf, 1...100.
    reduction : {"optimal", "half_rule"}, optional
        Reduction of a system, see `reduce_fopdt`.
    method : {"tustin", "forward", "backward"}, optional
        Discretization of the integral.
    dt : float, optional
        Sample time in s, for a process model or a continuous system.
    name : str, optional

    Returns
    -------
    PIDController
        A `control.StateSpace` from error to plant input, with the parameters as attributes. Its
        `check`, a `LoopCheck`, is for the closed loop with `system` itself, not with a reduced
        model, and with the models that the data of an identified system do not rule out, or over
        its intervals of dead time and gain.

    Raises
    ------
    OptionError
        A rule or kind that does not exist, or options that do not apply.
    UnsuitableSystemError
        An unstable plant, several channels, an integrating plant for a rule that does not allow it;
        or a controller that makes the loop with `system` itself unstable.

    Warns
    -----
    ModelWarning
        Ms is larger than 2 on the model itself, with one of those models, or at an end of those
        intervals; or the loop is unstable there. The warning names a rule that is robust, if there
        is one.

    Notes
    -----
    The rules are those of [1]_ (simc, sections 3 and 4), [2]_ and [3]_ (lambda, stable and
    integrating), [4]_ (imc, table II), [5]_ (amigo), [6]_ (both rules of Ziegler and Nichols),
    [7]_, [10]_ (chr), [11]_ and [12]_ (itae, load and set-point), [13]_ (PI) and [14]_ (PID of
    tyreus_luyben). The optimal rule solves the problem of [9]_, least absolute load error under a
    limit on the sensitivity (in [8]_: least integrated error), on the exact frequency response.

    References
    ----------
    .. [1] S. Skogestad, Simple analytic rules for model reduction and PID controller tuning, J.
       Process Control 13 (2003) 291-309, doi:10.1016/S0959-1524(02)00062-8.
    .. [2] E. B. Dahlin, Designing and tuning digital controllers, Instrum. Control Syst. 41 (1968)
       77-83.
    .. [3] I.-L. Chien and P. S. Fruehauf, Consider IMC tuning to improve controller performance,
       Chem. Eng. Progress 86 (1990) 33-41.
    .. [4] D. E. Rivera, M. Morari and S. Skogestad, Internal model control: PID controller design,
       Ind. Eng. Chem. Process Des. Dev. 25 (1986) 252-265, doi:10.1021/i200032a041.
    .. [5] K. J. Astrom and T. Hagglund, Advanced PID Control, ISA 2006, chapter 7 (A
       Ziegler-Nichols replacement).
    .. [6] J. G. Ziegler and N. B. Nichols, Optimum settings for automatic controllers, Trans. ASME
       64 (1942) 759-768, doi:10.1115/1.4019264.
    .. [7] G. H. Cohen and G. A. Coon, Theoretical consideration of retarded control, Trans. ASME 75
       (1953) 827-834.
    .. [8] K. J. Astrom, H. Panagopoulos and T. Hagglund, Design of PI controllers based on
       non-convex optimization, Automatica 34 (1998) 585-601, doi:10.1016/S0005-1098(98)00011-9.
    .. [9] O. Garpinger, T. Hagglund and K. J. Astrom, Performance and robustness trade-offs in PID
       control, J. Process Control 24 (2014) 568-577, doi:10.1016/j.jprocont.2014.02.020.
    .. [10] K. L. Chien, J. A. Hrones and J. B. Reswick, On the automatic control of generalized
       passive systems, Trans. ASME 74 (1952) 175-185.
    .. [11] A. M. Lopez, J. A. Miller, C. L. Smith and P. W. Murrill, Tuning controllers with
       error-integral criteria, Instrum. Technol. 14 (1967) 57-62.
    .. [12] A. A. Rovira, P. W. Murrill and C. L. Smith, Tuning controllers for setpoint changes,
       Instrum. Control Syst. 42 (1969) 67-69.
    .. [13] B. D. Tyreus and W. L. Luyben, Tuning PI controllers for integrator/dead time processes,
       Ind. Eng. Chem. Res. 31 (1992) 2625-2628, doi:10.1021/ie00011a029.
    .. [14] W. L. Luyben and M. L. Luyben, Essentials of Process Control, McGraw-Hill 1997.

    Examples
    --------
    >>> import control as ct
    >>> import ctrl_realize as cr
    >>> valve = cr.delayed_ss(ct.tf([1], [0.08, 1]), dead_time=0.029, dt=0.001)
    >>> cr.design.pid(valve)
    <PIDController 'PI_simc': kp = 1.356, ti = 0.08 s, dt = 0.001 s>
    >>> cr.design.pid(cr.design.ProcessModel(gain=1.0, lag=0.08, dead_time=0.029))
    <PIDController 'PI_simc': kp = 1.379, ti = 0.08 s, continuous>
    >>> plant = ct.tf([1], [0.08, 1]) * cr.delay(0.029)
    >>> controller = cr.design.pid(plant)
    >>> controller.check.margins
    <Margins stable: gain 3.142, phase 61.35 deg, modulus 0.6287, delay 62.11 ms>
    """
    given = locals()
    options = TuningOptions(**{one.name: given[one.name] for one in fields(TuningOptions)})
    plant = TuningPlant(system, dt)
    if options.closed_loop_time == "robust":  # as a number, with which the advice compares
        options = _robust(plant, options)
    made = tuned(plant, options)
    check = loop_check(plant.exact, made)
    if not check.stable or check.flags:
        with warnings.catch_warnings():  # what the record leaves open has been said
            warnings.simplefilter("ignore")
            advice = _one_that_works(plant, options)
        refuse_unstable(check, f"the {kind} controller of rule={rule!r}", advice)
        warn_of(check, advice)
    return made.checked(check)


@dataclass(frozen=True)
class TuningOptions:
    """Arguments of `pid` beside the system, which are checked without one."""

    rule: str = "simc"
    kind: str = "PI"
    closed_loop_time: float | Literal["robust"] | None = None
    max_sensitivity: float | None = None
    derivative_filter: float = 10.0
    reduction: str = "optimal"
    method: str = "tustin"
    dt: float | None = None
    name: str | None = None

    def __post_init__(self) -> None:
        """Check every argument that does not depend on the plant."""
        for name, choices in _CHOICES.items():  # whose case does not matter
            object.__setattr__(self, name, one_of(getattr(self, name), name, choices))
        rule, kind = self.rule, self.kind
        known = kinds_of(rule)
        if kind not in known:
            raise OptionError(f"rule={rule!r} has no {kind}; available: {', '.join(known)}")
        within(self.derivative_filter, "derivative_filter", "td / tf", 1, 100)
        if self.closed_loop_time is not None:
            if rule not in ADJUSTED:
                raise OptionError(
                    f"closed_loop_time= is an argument of simc, lambda and imc, not of {rule!r}"
                )
            if self.closed_loop_time != "robust":
                positive(self.closed_loop_time, "closed_loop_time", "time in s")
        if self.max_sensitivity is not None:
            if rule != "optimal":
                raise OptionError(f"max_sensitivity= is an argument of 'optimal', not of {rule!r}")
            within(self.max_sensitivity, "max_sensitivity", "Ms", 1.01, 10)


def tuned(plant: TuningPlant, options: TuningOptions) -> PIDController:
    """Tune by a rule without checking the loop."""
    if isinstance(options.closed_loop_time, str):
        return tuned(plant, _robust(plant, options))
    rule, kind, ratio, step = options.rule, options.kind, options.derivative_filter, plant.step
    model: ProcessModel | None = None
    if rule in MODEL_RULES:
        model = plant.reduced(rule == "simc" and "D" in kind, options.reduction)
        kp, ti, td = MODEL_RULES[rule][0](model, kind, options.closed_loop_time)
    elif rule == "optimal":
        limit = _USUAL_MS if options.max_sensitivity is None else options.max_sensitivity
        kp, ti, td = optimal(
            plant.sampled, plant.total_time, kind, max_sensitivity=limit, filter_ratio=ratio,
            method=options.method, direct=0.0 if step else turned_feedthrough(plant.exact),
        )  # fmt: skip
    else:
        kp, ti, td = from_ultimate(rule, kind, *critical_point(plant.exact))
    units = gain_and_time_units(plant.sampled)
    return PIDController(
        kp, ti, td, td / ratio, dt=step, method=options.method, rule=rule, model=model,
        name=options.name, gain_unit=units[0], time_unit=units[1],
    )  # fmt: skip


def _robust(plant: TuningPlant, options: TuningOptions) -> TuningOptions:
    """Options with the shortest closed-loop time that is robust."""
    model = tuned(plant, replace(options, closed_loop_time=None)).model
    assert model is not None
    shortest = model.dead_time or 0.1 * model.lag
    tried = []
    for share in LONGER:
        time = None if share == 1 else float(f"{share * shortest:.3g}")  # as it is suggested
        changed = replace(options, closed_loop_time=time)
        check = loop_check(plant.exact, tuned(plant, changed))
        if check.stable and not check.flags:
            return changed
        worst = np.inf if check.worst is None else check.worst.ms
        tried.append((max(check.margins.ms if check.stable else np.inf, worst), changed))
    return min(tried, key=lambda one: one[0])[1]


def _one_that_works(plant: TuningPlant, options: TuningOptions) -> str:
    """Suggest a call whose loop is robust, on the model and over its intervals."""
    usual = replace(options, closed_loop_time=None, max_sensitivity=None)
    tries = [
        replace(usual, rule=rule, kind=kind, reduction=reduction)
        for kind in dict.fromkeys((options.kind, "PI"))
        for rule in dict.fromkeys((options.rule, *SAFE))
        for reduction in REDUCTIONS
        if rule in MODEL_RULES and kind in kinds_of(rule)
    ]
    tries.append(replace(usual, rule="optimal", kind="PI"))
    tries.append(replace(usual, rule="simc", kind="PI", closed_loop_time="robust"))
    best: tuple[float, str] = (np.inf, "")
    for changed in tries:
        try:
            if changed.closed_loop_time == "robust":  # as a number, which can be given
                changed = _robust(plant, changed)
            if changed == options:
                continue
            made = tuned(plant, changed)
        except ValueError:
            continue
        check = loop_check(plant.exact, made)
        if not check.stable or check.margins.ms > MOST_SENSITIVE:
            continue
        worst = check.margins.ms if check.worst is None else check.worst.ms
        call = f"{_call(changed)}: Ms {check.margins.ms:.3g}"
        if not check.flags:
            if check.worst is None:
                return f"Try {call}"
            return f"Try {call}, at most {worst:.3g} with what the record leaves open"
        best = min(best, (worst, call))
    if best[1]:
        return (
            "No rule is robust with all that the record leaves open; the best is "
            f"{best[1]}, at worst {best[0]:.3g}"
        )
    return "No other rule does better; see design.compare_pid, or use design.lqg"


def _call(options: TuningOptions) -> str:
    """What to type for a rule, without the defaults."""
    usual, rule, kind = TuningOptions(), options.rule, options.kind
    words: dict[str, Any] = {"closed_loop_time": options.closed_loop_time, "dt": options.dt}
    if rule in MODEL_RULES:
        words["reduction"] = options.reduction
    if rule == "optimal":
        words["max_sensitivity"] = options.max_sensitivity
    given = [f"{key}={value!r}" for key, value in words.items() if value != getattr(usual, key)]
    return f"design.pid({', '.join(['sys', repr(rule), *[repr(kind)] * (kind != 'PI'), *given])})"
