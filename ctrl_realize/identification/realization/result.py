"""Result of the realization of an impulse response."""

from __future__ import annotations

from dataclasses import dataclass, field

from ..._checks import integer
from ..._wording import in_time
from ...data import ImpulseResponse, Record
from ...numerics.arrays import FloatArray, read_only
from ...numerics.hankel.delay_models import hankel_size, realize_at
from ...results import Flag, ModelFit
from .impulses import channels


class ImpulseFit(ModelFit):
    """What a model of an impulse response, with its `delay` in samples, says of it."""

    impulse: ImpulseResponse
    delay: int

    @property
    def dt(self) -> float:
        """Sample time in s."""
        return self.impulse.dt

    @property
    def dead_time(self) -> float:
        """`delay` in s."""
        return self.delay * self.dt

    @property
    def sampling(self) -> str:
        """How the impulse response was sampled."""
        return self.impulse.sampling

    @property
    def records(self) -> tuple[Record, ...]:
        """The record behind the impulse response, if it is known."""
        step = self.impulse.step
        return () if step is None or step.record is None else (step.record,)

    def _rows_before(self) -> list[tuple[str, str]]:
        """Tell which part of the static gain is in the response before the delay, as by a filter.

        It is not in the model.
        """
        whole = channels(self.impulse).sum(axis=-1)
        if whole.size > 1 or not self.delay or not whole.item():
            return []
        left = 100 * self.impulse.markov[..., : self.delay].sum() / whole.item()
        return [("before the delay", f"{left:.2g} % of the sum of G, not in the model")]


@dataclass(frozen=True, eq=False)
class Realization(ImpulseFit):
    """Result of the realization of an impulse response.

    ``iae`` is the sum of ``|impulse.markov[k] - sys.markov(n)[k]|`` over the ``n = delay + samples
    + 1`` samples that were used, for all channels together.

    Attributes
    ----------
    order : int
        States of the core.
    delay : int
        Delay in samples that was removed from the data.
    samples : int
        Markov parameters after the feedthrough that were used, ``delay + 1 ... delay + samples``.
    hankel : {"square", "padded"}
    feedthrough : bool
        Whether the feedthrough is G[delay]; otherwise it is 0.
    singular_values : ndarray, shape (q,), q >= order
        Leading singular values of the Hankel matrix: all of them if it is small, otherwise the
        `order` ones of the model. `leading_singular_values` computes more.
    next_singular_value : float
        Singular value ``order + 1``, the first that was truncated; for a Hankel matrix of more than
        200 rows an estimate from below.
    error_bound : float or None
        For the padded Hankel matrix: upper bound of the error (2-norm) at any frequency with
        respect to the data's own response, ``sum G[k] z^-k`` over the samples used. Twice the sum
        of the truncated singular values; if they are not all known, the largest value consistent
        with their sum of squares. None for the square one, for which no bound is known.
    iae : float
        Integrated absolute error, in the unit of the output per input.
    impulse : ImpulseResponse
        The impulse response.
    flags : tuple of Flag
        ``"unstable"``, ``"not_died_away"``, ``"negative_pole"``, ``"no_gap"``,
        ``"filter_delay"``.
    choices : tuple of str
        Automatic choices, with reasons.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> pulse = np.r_[0.0, 0.9 ** np.arange(99) + 0.01 * (-0.5) ** np.arange(99)]
    >>> found = cr.realize(pulse, 1, dt=0.1).fit
    >>> print(found.singular_values[0].round(2), round(found.next_singular_value, 4))
    5.26 0.0124
    >>> print(round(found.iae, 3))
    0.029
    """

    order: int
    delay: int
    samples: int
    hankel: str
    feedthrough: bool
    singular_values: FloatArray
    next_singular_value: float
    error_bound: float | None
    iae: float
    impulse: ImpulseResponse = field(repr=False)
    flags: tuple[Flag, ...] = ()
    choices: tuple[str, ...] = ()
    interval = delay_interval = None

    def leading_singular_values(self, count: int = 30) -> FloatArray:
        """Compute the first singular values of the Hankel matrix, as in the paper's Fig. 5.

        Returns
        -------
        ndarray, shape (count,), or fewer if the matrix is smaller
        """
        count = integer(count, "count", 1)
        padded = self.hankel == "padded"
        size = hankel_size(self.samples, padded=padded)
        count = min(count, size * min(self.impulse.ninputs, self.impulse.noutputs))
        if count <= self.singular_values.size:
            return self.singular_values[:count]
        markov = channels(self.impulse)
        model = realize_at(markov, self.delay, self.samples, count, padded=padded)
        return read_only(model.singular_values[:count])

    _method = "approximate realization"

    def _title(self) -> str:
        return f"Realization of order {self.order} after a delay of {self.delay} samples"

    def _rows(self) -> list[tuple[str, str]]:
        values = ", ".join(f"{value:.4g}" for value in self.singular_values[: self.order])
        in_samples = f"({self.delay} samples of {in_time(self.dt, 6)})"
        rows = [
            ("dead time", f"{in_time(self.delay * self.dt, 5)} {in_samples}"),
            ("Hankel matrix", f"{self.hankel}, {self.samples} samples"),
            ("feedthrough D", f"G[{self.delay}]" if self.feedthrough else "0"),
            ("singular values", f"{values} (next {self.next_singular_value:.4g})"),
            ("sum of |error|", f"{self.iae:.4g}"),
            *self._rows_before(),
        ]
        if self.error_bound is not None:
            rows.append(("error bound", f"{self.error_bound:.4g} at any frequency"))
        return rows

    def __repr__(self) -> str:
        flags = f", {len(self.flags)} flags" if self.flags else ""
        return (
            f"<Realization: order {self.order}, delay {self.delay} samples, IAE "
            f"{self.iae:.4g}{flags}>"
        )
