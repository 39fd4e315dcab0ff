"""Validation of identified models: residuals, prediction, new records."""

from .identification.validation.comparison import ModelComparison as ModelComparison
from .identification.validation.comparison import compare as compare
from .identification.validation.cross_validation import cross_validate as cross_validate
from .identification.validation.delay_estimates import (
    compare_delay_estimates as compare_delay_estimates,
)
from .identification.validation.delay_estimates_result import DelayComparison as DelayComparison
from .identification.validation.delay_estimates_result import DelayEstimate as DelayEstimate
from .identification.validation.prediction import Prediction as Prediction
from .identification.validation.prediction import predict as predict
from .identification.validation.residuals import analyse_residuals as analyse_residuals
from .identification.validation.residuals_result import ResidualAnalysis as ResidualAnalysis

__all__ = [
    "DelayComparison", "DelayEstimate", "ModelComparison", "Prediction", "ResidualAnalysis",
    "analyse_residuals", "compare", "compare_delay_estimates", "cross_validate", "predict",
]  # fmt: skip


def __dir__() -> list[str]:
    return __all__
