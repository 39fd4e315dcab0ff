"""Unit-pulse responses from measured steps (section 3.2 of the paper)."""

from __future__ import annotations

from typing import Literal

import numpy as np

from ..._checks import check_type, integer, one_of, positive
from ...data import FilterSpec, ImpulseResponse, StepResponse
from ...errors import OptionError
from ...numerics.arrays import FloatArray
from ...numerics.signals.filters import central_difference, low_pass, settling_samples
from ...numerics.signals.noise import quantisation_step, rest_noise
from ...numerics.signals.onset import rise_time

BANDWIDTH_TIMES_RISE = 0.35
"""-3 dB bandwidth in Hz times the 10-90 % rise time, for a lag of any order within 5 %."""

CUTOFF_OVER_BANDWIDTH = 13.0
"""Automatic cut-off: below 8 the filter distorts the response, above 15 it passes too much
noise."""

_QUIET = 1e-5
"""Noise over the range of a step response, up to which no filter is better: a zero-phase one begins
before the response. Of ten delays of a scan without noise 10 are right, with the filter 0; of ten
intervals 10 hold without it, 6 or 7 with it, up to 1e-5; 6 and 7 at 1e-4, 1 and 9 at 1e-3."""


def impulse_from_step(
    step: StepResponse,
    *,
    cutoff_hz: float | Literal["auto"] | None = "auto",
    filter_order: int = 5,
    zero_phase: bool = True,
    difference: Literal["backward", "central"] = "backward",
) -> ImpulseResponse:
    """Differentiate a step response and low-pass filter the result (section 3.2).

    Parameters
    ----------
    step : StepResponse
    cutoff_hz : float, "auto" or None, optional
        Cut-off of the Butterworth low-pass in Hz; the paper's is 50 Hz. ``"auto"``: 13 times the
        bandwidth of the step response (no filter if that is beyond 0.45 of the sample rate, or if
        the noise is less than 1e-5 of the response); None: no filter.
    filter_order : int, optional
        The paper's is 5.
    zero_phase : bool, optional
        Run the filter forward and backward, so that it adds no delay. A causal filter delays the
        response by its group delay: 13.1 samples for the paper's.
    difference : {"backward", "central"}, optional
        ``"backward"`` is step-invariant: exact for simulation and control with a hold.
        ``"central"`` is the paper's five-point formula; it samples the continuous impulse response,
        half a sample earlier.

    Returns
    -------
    ImpulseResponse
        Unit-pulse response from the step on; `.filter` is the filter that it contains, and `.noise`
        the result for the samples before the step.

    Raises
    ------
    OptionError
        A cut-off outside 0...half the sample rate, an order outside 1...10.

    Notes
    -----
    The lag of a causal filter stays in the model unless it is divided out: with the paper's
    settings 10 ms of delay.

    References
    ----------
    .. [1] J. van Helvoirt, O. Bosgra, B. de Jager and M. Steinbuch, Approximate realization of
       valve dynamics with time delay, Proc. 16th IFAC World Congress, 2005, section 3.2.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> t = 0.01 * np.arange(400)
    >>> u = np.where(t < 1.0, 0.0, 2.0)
    >>> y = np.where(t < 1.095, 0.0, 2 * (1 - np.exp(-(t - 1.1))))
    >>> g = cr.impulse_from_step(cr.unit_step(cr.Record(t, u, y)), cutoff_hz=None)
    >>> print(g.markov[9:13].round(4))
    [0.     0.     0.01   0.0099]
    """
    check_type(step, StepResponse, "step", "a StepResponse, see unit_step")
    order = integer(filter_order, "filter_order", 1, 10)
    difference = one_of(difference, "difference", ("backward", "central"))
    cutoff = _cutoff(step, cutoff_hz)
    # The samples before the step are included, so that differentiation and filter have settled at
    # the step. If there are too few, zeros are prepended.
    lead = 4 if cutoff is None else settling_samples(cutoff, step.dt) + 4
    zeros = np.zeros(max(lead - step.pre_step.size, 0))
    joint = np.concatenate([zeros, step.pre_step, step.output])
    edge = zeros.size + step.pre_step.size
    pulses = _differentiate(joint, difference)
    noise = _differentiate(step.pre_step, difference) if step.pre_step.size >= 20 else None
    if cutoff is not None:
        pulses = low_pass(pulses, order, cutoff, step.dt, zero_phase=zero_phase)
        if noise is not None:
            # Separately, so that a zero-phase filter carries nothing of the step into it.
            noise = low_pass(noise, order, cutoff, step.dt, zero_phase=zero_phase)
    return ImpulseResponse(
        pulses[edge:],
        step.dt,
        filter=None if cutoff is None else FilterSpec(order, cutoff, zero_phase, step.dt),
        noise=noise,
        sampling="step-invariant" if difference == "backward" else "impulse-invariant",
        name=step.name,
        step=step,
    )


def _cutoff(step: StepResponse, cutoff_hz: float | str | None) -> float | None:
    if cutoff_hz is None:
        return None
    rate = 1 / step.dt
    if isinstance(cutoff_hz, str):
        cutoff_hz = one_of(cutoff_hz, "cutoff_hz", ("auto",))
        rise = rise_time(step.output, step.dt)
        cutoff = CUTOFF_OVER_BANDWIDTH * BANDWIDTH_TIMES_RISE / rise
        noise = rest_noise(step.pre_step, step.output, quantisation_step(step.output))[0]
        quiet = noise <= _QUIET * float(np.ptp(step.output))
        return None if quiet or cutoff >= 0.45 * rate else cutoff
    cutoff = positive(cutoff_hz, "cutoff_hz", "cut-off in Hz")
    if cutoff >= rate / 2:
        raise OptionError(
            f"cutoff_hz={cutoff:g} Hz; expected a value below half the sample rate, "
            f"{rate / 2:g} Hz (None filters nothing)"
        )
    if settling_samples(cutoff, step.dt) > 10 * (step.output.size + step.pre_step.size):
        raise OptionError(
            f"cutoff_hz={cutoff:g} Hz: this filter takes {5 / cutoff:.3g} s to settle, the step "
            f"response is {step.output.size * step.dt:.3g} s long"
        )
    return cutoff


def _differentiate(values: FloatArray, difference: str) -> FloatArray:
    if difference == "central":
        return central_difference(values)
    return np.diff(values, prepend=values[0])  # G_k = S_k - S_(k-1), exact behind a hold
