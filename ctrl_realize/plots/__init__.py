"""Plots of results; each returns a `control.ControlPlot` and does not call show."""

from __future__ import annotations

from .campaigns import campaign_plot, gain_plot
from .delays import bootstrap_plot, delay_comparison_plot, track_plot
from .dispatch import draw
from .fits import dead_time_plot, each_record_plot, fit_plot
from .frequencies import frf_fit_plot, frf_plot, joint_fit_plot, truth_plot
from .frf_comparison import comparison_plot
from .loops import closed_loop_plot, margins_plot
from .records import onset_plot, record_plot, step_plot
from .residuals import (
    model_comparison_plot,
    prediction_plot,
    residual_plot,
    state_space_fit_plot,
)
from .responses import impulse_estimate_plot, impulse_plot, mimo_realization_plot, system_plot
from .robustness import delay_robustness_plot, robustness_plot, uncertainty_plot
from .scans import delay_plot, order_plot, singular_value_plot
from .tuning import hankel_plot, pid_comparison_plot, process_model_plot
from .valves.loops import (
    loop_diagnosis_plot,
)
from .valves.tests import (
    valve_plan_plot,
    valve_plot,
)

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
    "each_record_plot",
    "fit_plot",
    "frf_fit_plot",
    "frf_plot",
    "gain_plot",
    "hankel_plot",
    "impulse_estimate_plot",
    "impulse_plot",
    "joint_fit_plot",
    "loop_diagnosis_plot",
    "margins_plot",
    "mimo_realization_plot",
    "model_comparison_plot",
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
    "valve_plan_plot",
    "valve_plot",
]


def __dir__() -> list[str]:
    return __all__
