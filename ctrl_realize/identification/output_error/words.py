"""Words for the keys of the output-error estimate, as cards and flags use them."""

from __future__ import annotations

from ...numerics.output_error.result import RobustKey
from ...numerics.separable.dispersion import DispersedFlow
from ...numerics.separable.lag_chains import LagChain

ESTIMATE_WORDS: dict[RobustKey, str] = {
    "onset": "visible onset",
    "one_lag_early": "first-order model of the first 15 %",
    "two_lags_early": "second-order model of the first 15 %",
    "three_lags_early": "third-order model of the first 15 %",
    "model_of_rise": "best model of the first 63 %",
    "model_of_record": "best model of the whole record",
}


def model_words(model: LagChain | DispersedFlow) -> str:
    """Name a model that is not one of the structures."""
    if isinstance(model, DispersedFlow):
        return "axial-dispersion model"
    if model.hidden:
        return "diffusion model"
    return f"model of {model.candidate.structure.order} nearly equal lags"
