"""Misprints and open points of the paper."""

from __future__ import annotations

from dataclasses import dataclass


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


ERRATA = (
    Erratum(
        "E1",
        "section 2.1, step 4",
        "H_a = T(2:rho+1,1:rho), H_b = T(1:rho,1), H_c = T(1,1:rho): too small for U_rho",
        "r for rho: H_a = T(2:r+1,1:r), H_b = T(1:r,1), H_c = T(1,1:r)",
    ),
    Erratum(
        "E2",
        "section 2.1, step 5",
        "V_rho^T in A and C, wrong by dimension",
        "V_rho",
    ),
    Erratum(
        "E3",
        "section 2.1, step 1",
        "T is built 'from the step response sequence', but contains G",
        "G_k = S_k - S_(k-1), G_0 = S_0; a Hankel matrix of S itself has the pole 1 in it",
    ),
    Erratum(
        "E4",
        "section 2.1, step 4",
        "H_d = S_0, also for the shifted sequences of the delay scan",
        "D = G_d for the candidate delay d",
    ),
    Erratum(
        "E5",
        "section 2.1, step 1",
        "T has zeros for i + j > n + 1",
        "they never enter with r = floor(n/2); hankel='padded' is the version that uses them",
    ),
    Erratum(
        "E6",
        "section 3.1",
        "Nyquist frequency of 500 Hz at Ts = 7.8125e-4 s",
        "Nyquist is 640 Hz; 500 Hz = 1280 Hz / 2.56 is the alias-free band of the analyser",
    ),
    Erratum(
        "E7",
        "section 3.2",
        "'third order central difference', error O(Ts^4)",
        "the five-point stencil, which is of order 4",
    ),
    Erratum(
        "E8",
        "section 3.2",
        "half a sample between difference and model is not mentioned",
        "backward difference = step-invariant; central = impulse-invariant, half a sample early",
    ),
    Erratum(
        "E9",
        "section 3.2",
        "'must be properly scaled'",
        "Markov parameter = Ts dS/dt / A_s, scaled once; the delay found does not depend on it",
    ),
    Erratum(
        "E10",
        "section 2.1",
        "samples over which the IAE is taken are not given",
        "one fixed window 0 ... n + max_delay for all candidates",
    ),
    Erratum(
        "E11",
        "section 3.2",
        "causal or zero-phase filter is not stated",
        "zero-phase by default; causal for replication, its lag recorded and removable",
    ),
    Erratum(
        "E12",
        "section 3.2",
        "mean 'after removing the three smallest and highest values', population not given",
        "all 40 values pooled, 3 dropped at each end: 36.68 and 2.04 or 2.10",
    ),
    Erratum(
        "E13",
        "section 3.2",
        "good in the range of 0.01-13 Hz, measured from 0.1 Hz",
        "0.1-13 Hz",
    ),
    Erratum(
        "E14",
        "section 3.1",
        "frequency accuracy 0.1 Hz, with points from 0.1 Hz spaced 1.25 %",
        "every FRF carries its measured frequencies; they need not be monotone in the records",
    ),
    Erratum(
        "E15",
        "sections 2.1 and 3.2",
        "H_e and H_E; length n for a sequence of n + 1 samples",
        "one matrix; G_0 ... G_n with G_0 the feedthrough",
    ),
    Erratum(
        "E16",
        "section 2.2",
        "the 30 Hz of the LVDT is in both measurements and is not mentioned further",
        "it is in every 'valve' model: 5.3 ms or 6.8 samples of lag",
    ),
    Erratum(
        "E17",
        "section 3.2",
        "final model from the record of least IAE",
        "records are normalised first; averaging the records is the better way",
    ),
)
