"""Words for the keys of the output-error estimate, as cards and flags use them."""

from __future__ import annotations

from ...numerics.output_error.result import RobustKey
from ...numerics.separable.dispersion import DispersedFlow
from ...numerics.separable.lag_chains import LagChain

ESTIMATE_WORDS: dict[RobustKey, str] = {
    "onset": "first motion",
    "one_lag_early": "first-order lag, first 15 %",
    "two_lags_early": "second-order lag, first 15 %",
    "three_lags_early": "third-order lag, first 15 %",
    "model_of_rise": "best model of the first 63 %",
    "model_of_record": "best model of the whole record",
}


def model_words(model: LagChain | DispersedFlow) -> str:
    """Name a model that is not one of the structures."""
    if isinstance(model, DispersedFlow):
        return "a flow that disperses"
    if model.hidden:
        return "modes of diffusion"
    return f"chain of {model.candidate.structure.order} nearly equal lags"
