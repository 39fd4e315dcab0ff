"""Average a step response over bins that grow with the distance from its onset.

Some two hundred averages contain nearly all information of thousands of samples of a smooth
response, if they are single samples near the onset.

Our own rule: the width of a bin is 4 % of its distance from the onset. Lags faster than that
distance have decayed there, slower ones are nearly straight over the bin, and the model is averaged
over the same bins: there is no approximation, and little loss of information.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import FloatArray, IntArray

_GROWTH = 0.04  # of the distance from the onset; see above
BINS_AT_REST = 12  # means of the baseline, for its level and slope; samples for its noise
# Few different widths: everything that depends on the width alone is computed once for each.
_WIDTHS = np.unique((1.19 ** np.arange(80)).astype(np.int64))


@dataclass(frozen=True, eq=False)
class Bins:
    """Bins of samples: ``first[i]`` ... ``first[i] + width[i] - 1``."""

    first: IntArray
    width: IntArray

    def average(self, values: FloatArray) -> FloatArray:
        """Mean of every bin, for values of shape (N,) or (N, q)."""
        sums = np.add.reduceat(values[: int(self.first[-1] + self.width[-1])], self.first, axis=0)
        return np.asarray(sums / self.width.reshape(-1, *[1] * (values.ndim - 1)))

    def holding(self, rows: IntArray) -> Bins:
        """Bins of those samples that there are: numbers among `rows` (N,), no bin empty."""
        first = np.searchsorted(rows, self.first)
        width = np.searchsorted(rows, self.first + self.width) - first
        return Bins(first[width > 0], width[width > 0])


def response_bins(stop: int, edges: list[int], crossing: int, *, relaxing: bool = False) -> Bins:
    """Divide samples 0...stop - 1 of a record into bins.

    Parameters
    ----------
    stop : int
        Number of samples.
    edges : list of int
        Samples at which the input has moved; each starts a new response.
    crossing : int
        Visible onset after an edge, in samples. Bins are single samples there, and their width
        grows by 4 % of the distance from it.
    relaxing : bool, optional
        The record begins with a free response, which decays from its first sample on as a response
        does from its onset. Otherwise the samples before the first edge are twelve bins.
    """
    starts = [*edges, stop]
    onsets = np.array(edges) + crossing
    if relaxing:
        bounds, k, onsets = [0], 0, np.append(onsets, 0)
    else:
        k = edges[0]
        bounds = sorted({*np.linspace(0, k, min(BINS_AT_REST, k) + 1).astype(int)})
    while k < stop:
        distance = float(np.abs(onsets - k).min())
        width = int(_WIDTHS[np.searchsorted(_WIDTHS, max(_GROWTH * distance, 1.0), "right") - 1])
        following = min(s for s in starts if s > k)
        k = min(k + width, following)
        bounds.append(k)
    limits = np.array(bounds)
    return Bins(limits[:-1], np.diff(limits))
