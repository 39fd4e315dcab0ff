"""Plots of results; each returns a `control.ControlPlot` and never calls show."""

from __future__ import annotations

from .campaigns import campaign_plot as campaign_plot
from .delays import bootstrap_plot as bootstrap_plot
from .delays import delay_comparison_plot as delay_comparison_plot
from .delays import track_plot as track_plot
from .dispatch import draw as draw
from .fits import dead_time_plot as dead_time_plot
from .fits import fit_plot as fit_plot
from .frequencies import frf_fit_plot as frf_fit_plot
from .frequencies import frf_plot as frf_plot
from .frequencies import truth_plot as truth_plot
from .frf_comparison import comparison_plot as comparison_plot
from .impulses import impulse_estimate_plot as impulse_estimate_plot
from .impulses import impulse_plot as impulse_plot
from .impulses import mimo_realization_plot as mimo_realization_plot
from .loops import closed_loop_plot as closed_loop_plot
from .loops import margins_plot as margins_plot
from .records import onset_plot as onset_plot
from .records import record_plot as record_plot
from .records import step_plot as step_plot
from .residuals import prediction_plot as prediction_plot
from .residuals import residual_plot as residual_plot
from .residuals import state_space_fit_plot as state_space_fit_plot
from .robustness import delay_robustness_plot as delay_robustness_plot
from .robustness import robustness_plot as robustness_plot
from .robustness import uncertainty_plot as uncertainty_plot
from .scans import delay_plot as delay_plot
from .scans import order_plot as order_plot
from .scans import singular_value_plot as singular_value_plot
from .systems import system_plot as system_plot
from .tuning import hankel_plot as hankel_plot
from .tuning import pid_comparison_plot as pid_comparison_plot
from .tuning import process_model_plot as process_model_plot

__all__ = [
    "bootstrap_plot",
    "campaign_plot",
    "closed_loop_plot",
    "comparison_plot",
    "dead_time_plot",
    "delay_comparison_plot",
    "delay_plot",
    "delay_robustness_plot",
    "draw",
    "fit_plot",
    "frf_fit_plot",
    "frf_plot",
    "hankel_plot",
    "impulse_estimate_plot",
    "impulse_plot",
    "margins_plot",
    "mimo_realization_plot",
    "onset_plot",
    "order_plot",
    "pid_comparison_plot",
    "prediction_plot",
    "process_model_plot",
    "record_plot",
    "residual_plot",
    "robustness_plot",
    "singular_value_plot",
    "state_space_fit_plot",
    "step_plot",
    "system_plot",
    "track_plot",
    "truth_plot",
    "uncertainty_plot",
]


def __dir__() -> list[str]:
    return __all__
