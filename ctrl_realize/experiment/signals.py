"""Inputs of a test, scaled to -1...1 or 0...1, for a length in samples.

Every kind has one number that is to be chosen: the time in which a binary signal may change, or the
highest frequency of a multisine or a chirp.

References
----------
.. [1] K. R. Godfrey (ed.), Perturbation Signals for System Identification, Prentice Hall 1993,
   chapter 1 (maximum-length and inverse-repeat binary sequences, multisines).
.. [2] M. R. Schroeder, Synthesis of low-peak-factor signals and binary sequences with low
   autocorrelation, IEEE Trans. Inform. Theory 16 (1970) 85-89, doi:10.1109/TIT.1970.1054411.
.. [3] E. Van der Ouderaa, J. Schoukens and J. Renneboog, Peak factor minimization of input and
   output signals of linear systems, IEEE Trans. Instrum. Meas. 37 (1988) 207-212,
   doi:10.1109/19.6053.
.. [4] R. V. Jategaonkar, Flight Vehicle System Identification: A Time-Domain Methodology, 2nd ed.,
   AIAA 2015, chapter 2 (multistep 3-2-1-1 inputs).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from scipy.signal import max_len_seq

from ..numerics.arrays import ComplexArray, FloatArray

_DOUBLED = 2.0  # from one choice to the next: the error is flat about the best one
_MOST = 9  # choices of a kind: a range of 250
_CLIPPED, _TURNS = 0.9, 60  # of the peak, and times: the peak factor falls below 1.5
_BITS = 16  # of the longest register, 65535 changes
_TURNED = np.array([1, 1, 1, -1, -1, 1, -1], dtype=np.float64)  # 3-2-1-1

Shape = tuple[str, int, FloatArray]
"""Kind, number of samples that was chosen for it, and signal (N,)."""


def steps(count: int, hold: int) -> FloatArray:
    """Up and down in turn from 0 to 1, `hold` samples each."""
    return np.asarray((np.arange(count) // hold + 1) % 2, dtype=np.float64)


def three_two_one_one(count: int, unit: int) -> FloatArray:
    """Levels held for 3, 2, 1 and 1 units [4]_, and again with the other sign."""
    once = np.repeat(_TURNED, unit)
    return np.resize(np.concatenate([once, -once]), count)


def random_binary(count: int, clock: int) -> FloatArray:
    """Pseudo-random binary signal of maximum length, held for `clock` samples [1]_."""
    bits = int(np.clip(np.ceil(np.log2(count / clock + 2)), 3, _BITS))
    sequence = 2.0 * max_len_seq(bits)[0] - 1
    return np.resize(np.repeat(sequence, clock), count)


def multisine(count: int, shortest: int) -> FloatArray:
    """Flat multisine up to a period of `shortest` samples, its crest factor minimised.

    Phases by Schroeder [2]_, then by clipping and restoring the amplitudes [3]_.
    """
    tones = np.arange(1, max(count // shortest, 1) + 1)
    spectrum = np.zeros(count // 2 + 1, dtype=np.complex128)
    spectrum[tones] = np.exp(-1j * np.pi * tones * (tones - 1) / tones.size)
    best = _peak_one(spectrum, count)
    for _ in range(_TURNS):
        clipped = np.fft.rfft(np.clip(_peak_one(spectrum, count), -_CLIPPED, _CLIPPED))
        spectrum[tones] = np.exp(1j * np.angle(clipped[tones]))
        found = _peak_one(spectrum, count)
        if np.sum(found**2) > np.sum(best**2):
            best = found
    return best


def chirp(count: int, shortest: int) -> FloatArray:
    """Sine whose frequency rises linearly from one period in the test."""
    way = np.arange(count) / count
    periods = way + 0.5 * max(count / shortest - 1, 0.0) * way**2
    return np.asarray(np.sin(2 * np.pi * periods))


def _peak_one(spectrum: ComplexArray, count: int) -> FloatArray:
    wave = np.fft.irfft(spectrum, count)
    return np.asarray(wave / np.abs(wave).max())


KINDS: dict[str, tuple[Callable[[int, int], FloatArray], str, float, int]] = {
    "steps": (steps, "held", 1, 1),
    "3-2-1-1": (three_two_one_one, "unit", 1 / 7, 1),
    "random binary": (random_binary, "clock period", 1 / 6, 1),
    "multisine": (multisine, "shortest period", 1 / 3, 4),
    "chirp": (chirp, "shortest period", 1 / 3, 4),
}
"""Function of the samples of the test and of the number that is chosen, its name, and the smallest
choice, in dead time and lags together, and in samples.

Steps and 3-2-1-1 repeat after 2 and 14 units, and not within twice that time: a response that is
late by a period would be the same but for its beginning. Others change no faster than a sixth: what
is faster is hardly seen in the output, and with a clock of one sample one of 200 fits missed by 90
standard errors (`benchmarks.experiment`, first order, noise pole 0.9)."""


def shapes(count: int, slowest: float, *, returns: bool) -> Iterator[Shape]:
    """All kinds with all choices, in -1...1; `returns`: their sum is zero.

    `slowest` are dead time and lags in samples. A signal comes back by its second half, which is
    the first with the other sign (inverse-repeat [1]_).
    """
    length, once = (count // 2, "up and down") if returns else (count, "one step")
    for kind, (make, _, part, samples) in KINDS.items():
        least = max(part * slowest, samples)
        longest = length // (7 if kind == "3-2-1-1" else 1)
        wanted = {round(longest / _DOUBLED**i) for i in range(_MOST)}
        settling = {number for number in wanted if number >= least}
        for number in sorted(settling | {length} if kind == "steps" else settling, reverse=True):
            signal = make(length, number)
            if kind == "steps" and not returns:
                signal = 2 * signal - 1
            if returns:
                signal = np.concatenate([signal, -signal, np.zeros(count - 2 * length)])
            alone = kind == "steps" and number == length
            yield (once if alone else kind), number, signal
