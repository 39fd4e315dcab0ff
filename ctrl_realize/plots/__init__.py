"""Plots of results; each returns a `control.ControlPlot` and never calls show."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import control as ct

from .. import errors
from .campaigns import campaign_plot as campaign_plot
from .delays import bootstrap_plot as bootstrap_plot
from .delays import delay_check_plot as delay_check_plot
from .fits import dead_time_plot as dead_time_plot
from .fits import fit_plot as fit_plot
from .frequencies import frf_fit_plot as frf_fit_plot
from .frequencies import frf_plot as frf_plot
from .frequencies import truth_plot as truth_plot
from .frf_comparison import comparison_plot as comparison_plot
from .impulses import channels_plot as channels_plot
from .impulses import impulse_estimate_plot as impulse_estimate_plot
from .impulses import impulse_plot as impulse_plot
from .loops import closed_loop_plot as closed_loop_plot
from .loops import margins_plot as margins_plot
from .records import onset_plot as onset_plot
from .records import record_plot as record_plot
from .records import step_plot as step_plot
from .residuals import channel_fit_plot as channel_fit_plot
from .residuals import prediction_plot as prediction_plot
from .residuals import residual_plot as residual_plot
from .robustness import delay_robustness_plot as delay_robustness_plot
from .robustness import robustness_plot as robustness_plot
from .robustness import uncertainty_plot as uncertainty_plot
from .scans import delay_plot as delay_plot
from .scans import order_plot as order_plot
from .scans import singular_value_plot as singular_value_plot
from .tracks import track_plot as track_plot
from .tuning import hankel_plot as hankel_plot
from .tuning import pid_comparison_plot as pid_comparison_plot
from .tuning import process_model_plot as process_model_plot

__all__ = [
    "bootstrap_plot",
    "campaign_plot",
    "channel_fit_plot",
    "channels_plot",
    "closed_loop_plot",
    "comparison_plot",
    "dead_time_plot",
    "delay_check_plot",
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
    "onset_plot",
    "order_plot",
    "pid_comparison_plot",
    "prediction_plot",
    "process_model_plot",
    "record_plot",
    "residual_plot",
    "robustness_plot",
    "singular_value_plot",
    "step_plot",
    "track_plot",
    "truth_plot",
    "uncertainty_plot",
]


def __dir__() -> list[str]:
    return __all__


_DRAWN_BY: dict[str, Callable[..., ct.ControlPlot]] = {
    "BalancedReduction": hankel_plot,
    "Bootstrap": bootstrap_plot,
    "Campaign": campaign_plot,
    "StateSpaceFit": channel_fit_plot,
    "MimoRealization": channels_plot,
    "DelayComparison": delay_check_plot,
    "OutputErrorFit": fit_plot,
    "DelayRobustness": delay_robustness_plot,
    "DelayScan": delay_plot,
    "TrackHistory": track_plot,
    "FRFComparison": comparison_plot,
    "FRFFit": frf_fit_plot,
    "ImpulseEstimate": impulse_estimate_plot,
    "ImpulseResponse": impulse_plot,
    "Margins": margins_plot,
    "MeasuredFRF": frf_plot,
    "OrderScan": order_plot,
    "PIDComparison": pid_comparison_plot,
    "Prediction": prediction_plot,
    "ProcessModel": process_model_plot,
    "Realization": singular_value_plot,
    "Record": record_plot,
    "ResidualAnalysis": residual_plot,
    "RobustnessCheck": robustness_plot,
    "StepResponse": step_plot,
    "UncertaintyBound": uncertainty_plot,
    "ValveTruth": truth_plot,
}
"""Class of a result -> function that draws it."""


def draw(result: Any, **kwargs: Any) -> ct.ControlPlot:
    """Draw any result with the function that is made for its kind.

    ``result.plot(**kwargs)`` does the same.

    Parameters
    ----------
    result : Result
        Any result of this toolbox.
    **kwargs
        Passed on to the function.

    Returns
    -------
    control.ControlPlot

    Raises
    ------
    OptionError
        There is no picture of such a thing.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> from ctrl_realize import plots
    >>> record = cr.bench.valve().step_record(16, rng=5)
    >>> cplt = plots.draw(record)                # what record.plot() does
    >>> cplt.figure.axes[-1].get_xlabel()
    'time [s]'
    """
    for kind in type(result).__mro__:
        if kind.__name__ in _DRAWN_BY:
            return _DRAWN_BY[kind.__name__](result, **kwargs)
    if type(result).__name__ == "FitSummary":
        raise errors.OptionError(
            "a model file keeps the report of a fit but not its curves; identify the record "
            "again to plot them"
        )
    raise errors.OptionError(
        f"there is no picture of a {type(result).__name__}; there is one of "
        f"{', '.join(sorted(_DRAWN_BY))}"
    )
