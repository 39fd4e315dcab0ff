"""Numbers, texts, bytes and arrays of every kind, drawn from a `random.Random`."""

import struct
from collections.abc import Callable, Sequence
from random import Random
from typing import Any

import numpy as np

ODD_FLOATS = (
    0.0, -0.0, float("nan"), float("inf"), -float("inf"), 5e-324, -5e-324, 2.2250738585072014e-308,
    1.7976931348623157e308, -1.7976931348623157e308, 1.0 + 2**-52, 1e16, 1e70, 1.0001e70, 1e-70,
    9e-71, 1e154, 1e-154, 0.1, 1 / 3, 2.0**53 + 2,
)  # fmt: skip
ODD_SIGNS = (
    "\0\t\n\r\x0b\x1a\x1b\x7f\x85\xa0²½÷ßÄé€ŉµ−１٣अ中\u0301\u200b\u202e\u2028\ufeff\ufffd\U0001f600"
)
PLAIN_SIGNS = "abcxyzTUYe0123456789 +-.,;:|_/\\'\"#%$&*()[]{}<>=!?@^~`"


def sometimes(rng: Random, one_in: int) -> bool:
    """Say yes once in `one_in` times."""
    return rng.randrange(one_in) == 0


def any_float(rng: Random, *, finite: bool = False) -> float:
    """Draw a double: odd ones, whole ones, everyday ones, any bits."""
    kind = rng.randrange(5)
    if kind == 0:
        value = rng.choice(ODD_FLOATS)
    elif kind == 1:
        (value,) = struct.unpack("<d", rng.getrandbits(64).to_bytes(8, "little"))
    elif kind == 2:
        value = float(rng.randint(-1000, 1000))
    elif kind == 3:
        value = rng.choice((1.0, -1.0)) * 10.0 ** rng.uniform(-320, 308)
    else:
        value = rng.uniform(-10.0, 10.0)
    return 0.0 if finite and not np.isfinite(value) else value


def any_text(rng: Random, longest: int) -> str:
    """Draw a text of any signs, surrogates left out."""
    return "".join(
        rng.choice(PLAIN_SIGNS if rng.randrange(3) else ODD_SIGNS)
        for _ in range(rng.randint(0, longest))
    )


UNITS = (
    "°C", "µl/s", "Ω", "m³", "%", "$", "\\1", "\\g<0>", "{}", "kg·m²", "−", "‰", "mm:ss", "é", "",
)  # fmt: skip


def any_name(rng: Random) -> str:
    """Draw the name of a signal: a tag with dots, a unit in brackets, any printable signs."""
    kind = rng.randrange(4)
    if kind == 0:
        name = f"FIC{rng.randint(1, 999)}.{rng.choice(('OP', 'PV', 'SP'))}"
    elif kind == 1:
        name = rng.choice(PLAIN_SIGNS) * rng.randint(1, 3) + "x"
    else:
        signs = (chr(rng.choice((rng.randrange(0x250), rng.randrange(0x11000)))) for _ in range(9))
        name = "".join(sign for sign in signs if sign.isprintable())
    opening, closing = rng.choice(("[]", "()", "{}", "<>", "//", "  "))
    unit = f" {opening}{rng.choice(UNITS)}{closing}" if rng.randrange(2) else ""
    return f"n{name}{unit}.".strip()


def any_bytes(rng: Random, longest: int) -> bytes:
    """Draw bytes of any value."""
    count = rng.randint(0, longest)
    return rng.getrandbits(8 * count + 1).to_bytes(count + 1, "little")[:count]


def generator(rng: Random) -> np.random.Generator:
    """Make a generator of NumPy's."""
    return np.random.default_rng(rng.getrandbits(32))


def chosen(rng: Random, optional: dict[str, Callable[[Random], Any]]) -> dict[str, Any]:
    """Draw some of the arguments that may be given."""
    return {name: draw(rng) for name, draw in optional.items() if rng.randrange(4) == 0}


def of(*values: Any) -> Callable[[Random], Any]:
    """Make a draw of one of these values."""
    return lambda rng: rng.choice(values)


def some(rng: Random, draw: Callable[[Random], Any], most: int) -> list[Any]:
    """Draw up to `most` of a kind."""
    return [draw(rng) for _ in range(rng.randint(0, most))]


def any_array(rng: Random) -> Any:
    """Draw an array of any type and shape, a ragged list, or nothing of the kind."""
    kind = rng.randrange(10)
    if kind == 9:
        return rng.choice([None, "", "abc", 3, {}, [[1.0], [1.0, 2.0]], object()])
    if kind == 8:
        return some(rng, lambda r: some(r, any_float, 4), 4)
    if kind == 7:
        return some(rng, lambda r: r.choice([None, any_text(r, 2), any_float(r)]), 5)
    shape = tuple(rng.randint(0, 8) for _ in range(rng.choice((0, 1, 1, 1, 2, 3))))
    size = int(np.prod(shape))
    if kind == 6:
        values: Sequence[Any] = [any_text(rng, 3) for _ in range(size)]
        return np.array(values, dtype="U3").reshape(shape)
    if kind == 5:
        return np.array([rng.random() < 0.5 for _ in range(size)]).reshape(shape)
    if kind == 4:
        values = [complex(any_float(rng), any_float(rng)) for _ in range(size)]
        return np.array(values, dtype=complex).reshape(shape)
    if kind == 3:
        values = [rng.randint(-(2**62), 2**62) for _ in range(size)]
        return np.array(values, dtype="i8").reshape(shape)
    if kind == 2:
        return np.arange(float(size)).reshape(shape)
    return np.array([any_float(rng) for _ in range(size)], dtype="f8").reshape(shape)
