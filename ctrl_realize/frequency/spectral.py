"""Frequency response from records of noise, operating data or periodic signals."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Literal

import numpy as np

from .._checks import integer, one_of, within
from ..data import MeasuredFRF, Record
from ..data.given import check_complete, records_alike
from ..errors import DataError, OptionError, warn_caller
from .periods import from_periods
from .welch import Stream, from_segments


def spectral_frf(
    records: Record | Iterable[Record],
    *,
    method: Literal["H1", "H2", "Hv"] = "H1",
    segment: int | None = None,
    window: str | tuple[str, float] = "hann",
    overlap: float = 0.5,
    delay: int = 0,
    period: int | None = None,
    skip_periods: int = 1,
    name: str = "measured",
) -> MeasuredFRF:
    r"""Estimate a frequency response from input and output spectra.

    Without `period`: Welch's method, averaged spectra of overlapping windowed segments. With
    `period`: the mean over whole periods of a periodic input (multisine), which has no leakage, at
    the lines that the input excites.

    Parameters
    ----------
    records : Record or iterable of Record
        Any number of inputs and outputs (with `method` "H1", and without `period`). An iterable is
        read once and never held in memory, so it may be a generator that reads a long file piece by
        piece. No segment crosses the boundary of a record.
    method : {"H1", "H2", "Hv"}
        "H1" for noise on the output, "H2" for noise on the input, "Hv" is their geometric mean. For
        periodic records all three are the ratio of the mean spectra.
    segment : int, optional
        Samples per segment; default: a power of two, about an eighth of the first record, at most
        8192.
    window : str or tuple, default "hann"
        Any window of `scipy.signal.get_window`.
    overlap : float, default 0.5
        Overlap of neighbouring segments, 0...0.95.
    delay : int, default 0
        Known dead time in samples. The output is shifted by it before the segments are cut, and the
        phase is corrected afterwards: the segments of input and output then correspond, and the
        estimate has no bias of ``delay / segment``.
    period : int, optional
        Samples per period of the input.
    skip_periods : int, default 1
        Periods to leave out at the start of each record, because of the transient.
    name : str, default "measured"
        Name of the result in plots.

    Returns
    -------
    MeasuredFRF
        With coherence and the standard deviation of the complex response, estimated from `repeats`
        periods or independent segments (`MeasuredFRF.circle`). With several channels, shape
        (outputs, inputs, K); the coherence is then the multiple coherence of each output, the same
        for all its inputs.

    Raises
    ------
    DataError
        Records too short for two segments or periods, of different sample time or channels, or
        inputs that do not excite the plant or are not independent.
    OptionError
        Invalid options.

    Warns
    -----
    DataWarning
        A record has a set point: the controller answers the noise, which makes a ratio of spectra
        that of plant and controller together [1]_.

    Notes
    -----
    H1, H2 and Hv are compared in [4]_. The coherence is :math:`\gamma^2 = |S_{yu}|^2 / (S_{uu}
    S_{yy})`. The variance of the complex response is :math:`|H|^2 (1 - \gamma^2) / (\gamma^2 (K -
    1))` with K independent segments [3]_: the number of segments, reduced for their overlap [2]_.
    For periods it is estimated from their scatter [1]_.

    This scatter contains only what differs from period to period, not errors that repeat: the
    nonlinear distortions of a plant for a multisine, and the rounding of a converter without noise.
    For a sensor with a quadratic term of a tenth the 95 % circles contained the linear response at
    one point of five.

    A file that does not fit into memory can be read piece by piece::

        n, t = 2**20, dt * np.arange(2**20)
        u, y = (np.memmap(name, dtype="f4", mode="r") for name in ("u.bin", "y.bin"))
        pieces = (cr.Record(t, u[k : k + n], y[k : k + n]) for k in range(0, u.size - n + 1, n))
        frf = cr.spectral_frf(pieces, segment=8192)

    If the input is held between the samples, this is the response of the *sampled* plant, which
    includes the hold. The result has a `sample_time`, from which `fit_frf`, `compare_frf` and
    `impulse_from_frf` conclude that the input was held. If it was not (a record of analog signals
    with anti-aliasing filters), give them ``hold=None``.

    References
    ----------
    .. [1] R. Pintelon and J. Schoukens, System Identification: A Frequency Domain Approach, 2nd
       ed., Wiley 2012, chapter 2, doi:10.1002/9781118287422.
    .. [2] P. D. Welch, The use of fast Fourier transform for the estimation of power spectra, IEEE
       Trans. Audio Electroacoust. 15 (1967) 70-73, doi:10.1109/TAU.1967.1161901.
    .. [3] J. S. Bendat and A. G. Piersol, Random Data, 4th ed., Wiley 2010, chapter 9,
       doi:10.1002/9781118032428.
    .. [4] G. T. Rocklin, J. Crowley and H. Vold, A comparison of H1, H2, and Hv frequency response
       functions, Proc. 3rd Int. Modal Analysis Conf. (1985) 272-278.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> u = np.random.default_rng(0).standard_normal(20_000)
    >>> y = 2 * np.roll(u, 5)
    >>> frf = cr.spectral_frf(cr.Record(0.01 * np.arange(u.size), u, y), delay=5)
    >>> print(round(abs(frf.complex[10]), 3), frf.coherence.min() > 0.9999)
    2.0 True
    """
    method = one_of(method, "method", ("H1", "H2", "Hv"))
    integer(delay, "delay", 0)
    stream = _aligned(records, delay)
    if period is not None:
        integer(period, "period", 4)
        integer(skip_periods, "skip_periods", 0)
        if segment is not None:
            raise OptionError(
                "expected segment or period, got both; give only period for periodic records"
            )
        found, dt = from_periods(stream, period, skip_periods)
    else:
        within(overlap, "overlap", "part", 0, 0.95)
        found, dt = from_segments(stream, method, segment, window, overlap)
    response = found.response * np.exp(-2j * np.pi * found.frequency_hz * delay * dt)
    return MeasuredFRF(**vars(replace(found, response=response)), sample_time=dt, name=name)


def _aligned(records: Record | Iterable[Record], delay: int) -> Stream:
    """Yield input, output (advanced by `delay`) and sample time of each record."""
    told = False
    for record in records_alike(records):
        if record.reference is not None and not told:
            told = True
            warn_caller(
                f"{record!r} has a set point: noise that the controller answers pulls the response "
                "towards the inverse of the controller. identify(record) uses the set point r; so "
                "does the quotient of spectral_frf(Record(t, r, y)) and spectral_frf(Record(t, r, "
                "u)), for fit_frf(..., hold='zoh', dt=)"
            )
        check_complete(record, "spectral_frf")
        u, y = np.atleast_2d(record.input), np.atleast_2d(record.output)
        if delay >= u.shape[1]:
            raise DataError(f"delay={delay} leaves no samples of {record!r}")
        yield u[:, : u.shape[1] - delay], y[:, delay:], record.dt
