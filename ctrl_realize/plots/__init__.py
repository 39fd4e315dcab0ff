"""Plots of results; each returns a `control.ControlPlot` and never calls show."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import control as ct

from .. import errors
from .bootstraps import bootstrap_plot as bootstrap_plot
from .campaigns import campaign_plot as campaign_plot
from .design_plots import closed_loop_plot as closed_loop_plot
from .design_plots import hankel_plot as hankel_plot
from .design_plots import margins_plot as margins_plot
from .design_plots import pid_comparison_plot as pid_comparison_plot
from .design_plots import process_model_plot as process_model_plot
from .diagnostics import channel_fit_plot as channel_fit_plot
from .diagnostics import channels_plot as channels_plot
from .diagnostics import delay_check_plot as delay_check_plot
from .diagnostics import impulse_estimate_plot as impulse_estimate_plot
from .diagnostics import prediction_plot as prediction_plot
from .diagnostics import residual_plot as residual_plot
from .fits import dead_time_plot as dead_time_plot
from .fits import fit_plot as fit_plot
from .frequencies import comparison_plot as comparison_plot
from .frequencies import frf_plot as frf_plot
from .impulses import impulse_plot as impulse_plot
from .others import frf_fit_plot as frf_fit_plot
from .others import track_plot as track_plot
from .others import truth_plot as truth_plot
from .records import onset_plot as onset_plot
from .records import record_plot as record_plot
from .records import step_plot as step_plot
from .robustness_plots import delay_robustness_plot as delay_robustness_plot
from .robustness_plots import robustness_plot as robustness_plot
from .robustness_plots import uncertainty_plot as uncertainty_plot
from .scans import delay_plot as delay_plot
from .scans import order_plot as order_plot
from .scans import singular_value_plot as singular_value_plot

_DRAWN_BY = {
    "BalancedReduction": "design_plots:hankel_plot",
    "Campaign": "campaigns:campaign_plot",
    "ChannelFit": "diagnostics:channel_fit_plot",
    "ChannelRealization": "diagnostics:channels_plot",
    "DelayCheck": "diagnostics:delay_check_plot",
    "Bootstrap": "bootstraps:bootstrap_plot",
    "DelayFit": "fits:fit_plot",
    "DelayRobustness": "robustness_plots:delay_robustness_plot",
    "DelayScan": "scans:delay_plot",
    "DelayTrack": "others:track_plot",
    "FRFComparison": "frequencies:comparison_plot",
    "FRFFit": "others:frf_fit_plot",
    "ImpulseEstimate": "diagnostics:impulse_estimate_plot",
    "ImpulseResponse": "impulses:impulse_plot",
    "Margins": "design_plots:margins_plot",
    "MeasuredFRF": "frequencies:frf_plot",
    "OrderScan": "scans:order_plot",
    "PIDComparison": "design_plots:pid_comparison_plot",
    "Prediction": "diagnostics:prediction_plot",
    "ProcessModel": "design_plots:process_model_plot",
    "Realization": "scans:singular_value_plot",
    "Record": "records:record_plot",
    "ResidualCheck": "diagnostics:residual_plot",
    "RobustnessCheck": "robustness_plots:robustness_plot",
    "StepResponse": "records:step_plot",
    "UncertaintyBound": "robustness_plots:uncertainty_plot",
    "ValveTruth": "others:truth_plot",
}
"""Class of a result -> module of this package and function that draws it."""


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
            module, function = _DRAWN_BY[kind.__name__].split(":")
            drawn: ct.ControlPlot = getattr(import_module(f".{module}", __name__), function)(
                result, **kwargs
            )
            return drawn
    if type(result).__name__ == "FitSummary":
        raise errors.OptionError(
            "a model file keeps the report of a fit and not its curves; identify the record "
            "again to draw them"
        )
    raise errors.OptionError(
        f"there is no picture of a {type(result).__name__}; there is one of "
        f"{', '.join(sorted(_DRAWN_BY))}"
    )
