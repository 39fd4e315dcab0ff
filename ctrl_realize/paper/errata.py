"""Misprints and open points of the paper."""

from __future__ import annotations

from dataclasses import dataclass

from .._facts import facts


@dataclass(frozen=True)
class Erratum:
    """A misprint or an open point of the paper, and its treatment in this toolbox.

    Parameters
    ----------
    code : str
        E1 ... E17.
    place : str
        Place in the paper.
    printed : str
        What is printed, or missing.
    read_as : str
        What is implemented.

    Examples
    --------
    >>> from ctrl_realize import paper
    >>> erratum = paper.ERRATA[0]
    >>> print(erratum.code, "-", erratum.place)
    E1 - section 2.1, step 4
    >>> print(erratum.read_as)
    r for rho: H_a = T(2:r+1,1:r), H_b = T(1:r,1), H_c = T(1,1:r)
    """

    code: str
    place: str
    printed: str
    read_as: str


ERRATA = tuple(Erratum(code, **row) for code, row in facts("paper/errata.toml").items())
