"""One realization of any length, long sequences and many channels."""

from __future__ import annotations

from collections.abc import Iterator

import control as ct
import numpy as np

import ctrl_realize as cr
from ctrl_realize.numerics.hankel.matrix import hankel_matrix

from .measure import Line, cpu_seconds, once, peak_megabytes, seconds
from .rigs import LONG_RECORDS, channels, long_pulse, long_record

LENGTHS = (10_000, 31_623, 100_000, 316_228, 1_000_000)


def by_control(data: np.ndarray, order: int) -> None:
    """Realize by python-control with the square Hankel matrix."""
    half = (data.size - 1) // 2
    ct.eigensys_realization(data, order, m=half, n=half)


def lines(*, full: bool) -> Iterator[Line]:
    """Time single realizations; `full` runs the baselines that take minutes and gigabytes."""
    small = long_pulse(1001, 3)
    slow = cpu_seconds(lambda: by_control(small, 3), least=1.0)
    fast = cpu_seconds(lambda: cr.realize(small, 3, dt=1.0))
    yield Line(
        "one realization, n = 1000, order 3", seconds(fast), seconds(slow), slow / fast,
        "30", "50", "python-control, measured",
    )  # fmt: skip
    data = long_pulse(10_001, 3)
    if full:
        slow, how = once(lambda: by_control(data, 3)), "python-control, measured"
    else:
        part = 2500
        slow = once(lambda: by_control(data[: part + 1], 3)) * (10_000 / part) ** 3
        how = f"python-control, n = {part} measured, growing with n^3 (3.0 to 3.3 was measured)"
    fast = cpu_seconds(lambda: cr.realize(data, 3, dt=1.0))
    yield Line(
        "one realization, n = 10 000, order 3", seconds(fast), seconds(slow), slow / fast,
        "5000", "20000", how,
    )  # fmt: skip
    for order in (3, 10):
        yield long_line(order)
    yield mimo_line(full=full)


def long_lines(*, full: bool) -> Iterator[Line]:
    """Identify long records with inputs and noise of many kinds."""
    for kind in LONG_RECORDS:
        yield record_line(kind, 10_000_000 if full else 1_000_000)


def record_line(kind: str, samples: int) -> Line:
    """A record of one input and output: time of `identify`, and memory beside the record."""
    data = long_record(kind, samples)
    fits: list[float] = []
    spent = once(lambda: fits.append(cr.identify(data).fit.delay))
    megabytes = peak_megabytes(
        "import ctrl_realize as cr\nfrom benchmarks.speed.rigs import long_record\n"
        f"data = long_record({kind!r}, {samples})\ncr.identify(long_record({kind!r}, 3000))",
        "cr.identify(data)",
    )
    ratio = megabytes * 1e6 / (3 * data.time.nbytes)
    return Line(
        f"identify, {kind}, {samples:.0e} samples: dead time {fits[0]:.4g} (12.37) samples, "
        f"{ratio:.1f} x the record's memory beside it",
        seconds(spent), "", None, "60 s, 2 x at 1e7", "", "no peer fits the dead time in one go",
    )  # fmt: skip


def long_line(order: int) -> Line:
    """n up to a million: time, growth and memory."""
    times = []
    for n in LENGTHS:
        data = cr.ImpulseResponse(long_pulse(n + 1, order), 1.0)
        times.append(cpu_seconds(lambda data=data: cr.realize(data, order), runs=3, least=2.0))
    exponent = float(np.polyfit(np.log(LENGTHS), np.log(times), 1)[0])
    memory = peak_megabytes(
        "import ctrl_realize as cr\nfrom benchmarks.speed.rigs import long_pulse\n"
        f"data = cr.ImpulseResponse(long_pulse(1_000_001, {order}), 1.0)\n"
        f"cr.realize(long_pulse(1001, {order}), {order}, dt=1.0)",
        f"cr.realize(data, {order})",
    )
    return Line(
        f"one realization, n = 1 000 000, order {order}, clear gap: {memory:.0f} MB above the "
        f"data, growth n^{exponent:.2f} from 10 000 on",
        seconds(times[-1]), "2 TB", None, "150 MB, n^1.25", "75 MB, n^1.15",
        "a dense Hankel matrix would have 2 TB",
    )  # fmt: skip


def mimo_line(*, full: bool) -> Line:
    """Ten by ten channels, a 5000 x 5000 block Hankel matrix."""
    data = channels(10, 10, 1000, 20, 1e-2)
    size = 500 if full else 125
    slow = once(lambda: np.linalg.svd(hankel_matrix(data[:, :, 1:], size, size)))
    slow *= (500 / size) ** 3
    impulse = cr.ImpulseResponse(data, 1.0)
    fast = cpu_seconds(lambda: cr.realize(impulse, 20))
    memory = peak_megabytes(
        "import ctrl_realize as cr\nfrom benchmarks.speed.rigs import channels\n"
        "cr.realize(cr.ImpulseResponse(channels(2, 2, 400, 4, 0.01), 1.0), 4)\n"
        "data = cr.ImpulseResponse(channels(10, 10, 1000, 20, 1e-2), 1.0)",
        "cr.realize(data, 20)",
    )
    how = "dense SVD (NumPy), measured" if full else "dense SVD (NumPy), 1250 x 1250 scaled by n^3"
    return Line(
        f"10 x 10 channels, n = 1000, order 20: {memory:.0f} MB above the data",
        seconds(fast), seconds(slow), slow / fast, "300, 50 MB", "900", how,
    )  # fmt: skip
