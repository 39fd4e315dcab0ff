"""Balanced truncation of the core; the delay is kept."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import control as ct
import numpy as np
from scipy.linalg import block_diag

from ..._checks import integer
from ...delayed import DelayedStateSpace
from ...delayed.parts import signals_of
from ...errors import OrderError
from ...numerics.arrays import FloatArray, read_only
from ...numerics.blas_threads import single_threaded
from ...numerics.state_space.balancing import Part, balanced_truncation, split_modes
from ...results import Flag, ModelFit
from ..siso import delayed_system

STABLE = 1 - 1e-9


@dataclass(frozen=True, eq=False, repr=False)
class BalancedReduction(ModelFit):
    """Result of a reduction of the core.

    ``error_bound = 2 * singular_values[kept:].sum()``, where ``kept = order - kept_unstable``,
    bounds the error of the frequency response.

    Attributes
    ----------
    singular_values : ndarray, shape (k,)
        Hankel singular values of the stable part of the core, descending.
    order : int
        Order of the reduced core, unstable part included.
    full_order : int
    kept_unstable : int
        States on or outside the unit circle, which are never reduced.
    error_bound : float
    choices : tuple of str
    flags : tuple of Flag

    Examples
    --------
    >>> import control as ct
    >>> import ctrl_realize as cr
    >>> lags = ct.tf([1], [0.08, 1]) * ct.tf([1], [0.02, 1]) * ct.tf([1], [0.001, 1])
    >>> found = cr.design.reduce(cr.delayed_ss(lags, dead_time=0.03, dt=0.001), 2).fit
    >>> print(found.singular_values.round(4), f"error at most {found.error_bound:.1e}")
    [5.759e-01 7.630e-02 4.000e-04] error at most 7.4e-04
    """

    singular_values: FloatArray
    order: int
    full_order: int
    kept_unstable: int
    error_bound: float
    choices: tuple[str, ...] = ()
    flags: tuple[Flag, ...] = ()
    dead_time = interval = delay = delay_interval = None
    records = ()

    _method = "balanced truncation"

    _heading = "Balanced truncation"

    def _rows(self) -> list[tuple[str, str]]:
        return [
            ("order", f"{self.full_order} -> {self.order}"),
            ("unstable poles kept", f"{self.kept_unstable} (on or outside the unit circle)"),
            ("largest error at any frequency", f"{self.error_bound:.4g}"),
        ]

    def __repr__(self) -> str:
        return (
            f"<BalancedReduction {self.full_order} -> {self.order}, "
            f"error <= {self.error_bound:.3g}>"
        )


@single_threaded
def hankel_singular_values(system: Any) -> FloatArray:
    """Compute the Hankel singular values of the stable part of a discrete core, descending.

    The delay is excluded: it would add d values for each input.

    Parameters
    ----------
    system : DelayedStateSpace
        Any number of channels; any discrete system.

    Returns
    -------
    ndarray, shape (k,)

    Notes
    -----
    Square roots of the eigenvalues of the product of both Gramians [1]_, [2]_.

    References
    ----------
    .. [1] B. C. Moore, Principal component analysis in linear systems: controllability,
       observability, and model reduction, IEEE Trans. Automat. Control 26 (1981) 17-32,
       doi:10.1109/TAC.1981.1102568.
    .. [2] L. Pernebo and L. M. Silverman, Model reduction via balanced state space representations,
       IEEE Trans. Automat. Control 27 (1982) 382-387, doi:10.1109/TAC.1982.1102945.

    Examples
    --------
    >>> import control as ct
    >>> import ctrl_realize as cr
    >>> core = ct.ss([[0.5]], [[1.0]], [[1.0]], [[0.0]], 0.1)
    >>> print(cr.design.hankel_singular_values(cr.delayed_ss(core, 37)).round(6))
    [1.333333]
    """
    core = delayed_system(system, "hankel_singular_values", siso=False).delay_free
    (A, B, C), _ = _parts(core)
    return balanced_truncation(A, B, C, 0)[3]


@single_threaded
def reduce(system: Any, order: int) -> DelayedStateSpace:
    """Reduce the order of the core by balanced truncation, and keep the delay.

    Poles on or outside the unit circle are kept. python-control's ``balred`` applies the continuous
    algorithm to discrete systems and returns a continuous one.

    Parameters
    ----------
    system : DelayedStateSpace
        Any number of channels; any discrete system.
    order : int
        Order of the reduced core; `hankel_singular_values` tell the error bound of each.

    Returns
    -------
    DelayedStateSpace
        Its ``.fit`` is a `BalancedReduction`.

    Raises
    ------
    OrderError
        An order larger than the core's, or smaller than its unstable part.

    Notes
    -----
    Balanced truncation [1]_, [2]_, by the square-root method [3]_. The error is bounded by twice
    the sum of the truncated Hankel singular values [4]_, also in discrete time [5]_.

    References
    ----------
    .. [1] B. C. Moore, Principal component analysis in linear systems: controllability,
       observability, and model reduction, IEEE Trans. Automat. Control 26 (1981) 17-32,
       doi:10.1109/TAC.1981.1102568.
    .. [2] L. Pernebo and L. M. Silverman, Model reduction via balanced state space representations,
       IEEE Trans. Automat. Control 27 (1982) 382-387, doi:10.1109/TAC.1982.1102945.
    .. [3] M. S. Tombs and I. Postlethwaite, Truncated balanced realization of a stable non-minimal
       state-space system, Int. J. Control 46 (1987) 1319-1330, doi:10.1080/00207178708933971.
    .. [4] K. Glover, All optimal Hankel-norm approximations of linear multivariable systems and
       their L-infinity error bounds, Int. J. Control 39 (1984) 1115-1193,
       doi:10.1080/00207178408933239.
    .. [5] U. M. Al-Saggaf and G. F. Franklin, An error bound for a discrete reduced order model of
       a linear multivariable system, IEEE Trans. Automat. Control 32 (1987) 815-819.

    Examples
    --------
    >>> import control as ct
    >>> import ctrl_realize as cr
    >>> lags = ct.tf([1], [0.08, 1]) * ct.tf([1], [0.02, 1]) * ct.tf([1], [0.001, 1])
    >>> plant = cr.delayed_ss(lags, dead_time=0.03, dt=0.001)
    >>> small = cr.design.reduce(plant, 2)
    >>> small.delay, small.fit
    (30, <BalancedReduction 3 -> 2, error <= 0.000744>)
    """
    plant = delayed_system(system, "reduce", siso=False)
    core = plant.delay_free
    (A, B, C), rest = _parts(core)
    kept = rest[0].shape[0]
    wanted = integer(order, "order", 0) - kept
    if wanted < 0 or order > core.nstates:
        raise OrderError(
            f"order={order}; the core has order {core.nstates}, of which {kept} state(s) on or "
            f"outside the unit circle are kept: expected {kept}...{core.nstates}"
        )
    A, B, C, values = balanced_truncation(A, B, C, wanted)
    n = A.shape[0]
    both = block_diag(A, rest[0]), np.vstack([B, rest[1]]), np.hstack([C, rest[2]])
    reduced = ct.StateSpace(*both, np.asarray(core.D), core.dt, remove_useless_states=False)
    fit = BalancedReduction(
        singular_values=read_only(values),
        order=n + kept,
        full_order=core.nstates,
        kept_unstable=kept,
        error_bound=float(2 * values[n:].sum()),
    )
    delays, names = (plant.input_delays, plant.output_delays), signals_of(plant)
    name = f"{plant.name}_reduced"
    settings = {"fit": fit, "name": name, "time_unit": plant.time_unit, **names}
    return DelayedStateSpace(reduced, delays[0], output_delay=delays[1], **settings)


def _parts(core: ct.StateSpace) -> tuple[Part, Part]:
    """Stable part, and the part with poles on or outside the unit circle."""
    A, B, C = (np.asarray(M, dtype=np.float64) for M in (core.A, core.B, core.C))
    if np.all(np.abs(np.linalg.eigvals(A)) < STABLE):
        n = A.shape[0]
        return (A, B, C), (np.zeros((0, 0)), B[:0], C[:, n:])
    return split_modes(A, B, C, lambda z: abs(z) < STABLE)
