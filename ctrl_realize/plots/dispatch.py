"""Which function draws which kind of result."""

from __future__ import annotations

from functools import singledispatch
from typing import Any

import control as ct

from .. import errors
from ..bench.truth import ValveTruth
from ..data.frf import MeasuredFRF
from ..data.impulse import ImpulseResponse
from ..data.impulse_estimate import ImpulseEstimate
from ..data.record import Record
from ..data.step import StepResponse
from ..delayed import DelayedStateSpace
from ..design.loops.delay_robustness import DelayRobustness
from ..design.loops.margin_result import Margins
from ..design.loops.robustness import RobustnessCheck, UncertaintyBound
from ..design.models.balanced import BalancedReduction
from ..design.models.process_model import ProcessModel
from ..design.tuning.table import PIDComparison
from ..frequency.comparison import FRFComparison
from ..frequency.frf_fit import FRFFit
from ..identification.campaign.campaign import Campaign
from ..identification.output_error.result import OutputErrorFit
from ..identification.realization.delay_scan_result import DelayScan
from ..identification.realization.mimo import MimoRealization
from ..identification.realization.order_scan import OrderScan
from ..identification.realization.result import Realization
from ..identification.state_space_fit.result import StateSpaceFit
from ..identification.tracking.results import TrackHistory
from ..identification.validation.bootstrap import Bootstrap
from ..identification.validation.delay_estimates_result import DelayComparison
from ..identification.validation.prediction import Prediction
from ..identification.validation.residuals_result import ResidualAnalysis
from ..io.stored_fit import FitSummary
from .campaigns import campaign_plot
from .delays import bootstrap_plot, delay_comparison_plot, track_plot
from .fits import fit_plot
from .frequencies import frf_fit_plot, frf_plot, truth_plot
from .frf_comparison import comparison_plot
from .impulses import impulse_estimate_plot, impulse_plot, mimo_realization_plot
from .loops import margins_plot
from .records import record_plot, step_plot
from .residuals import prediction_plot, residual_plot, state_space_fit_plot
from .robustness import delay_robustness_plot, robustness_plot, uncertainty_plot
from .scans import delay_plot, order_plot, singular_value_plot
from .systems import system_plot
from .tuning import hankel_plot, pid_comparison_plot, process_model_plot


@singledispatch
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
    raise errors.OptionError(
        f"there is no plot of a {type(result).__name__}; there is one of "
        f"{', '.join(sorted(kind.__name__ for kind in draw.registry if kind is not object))}"
    )


@draw.register
def _no_curves(result: FitSummary, **kwargs: Any) -> ct.ControlPlot:
    raise errors.OptionError(
        "a model file keeps the report of a fit but not its curves; identify the record "
        "again to plot them"
    )


draw.register(BalancedReduction, hankel_plot)
draw.register(Bootstrap, bootstrap_plot)
draw.register(Campaign, campaign_plot)
draw.register(StateSpaceFit, state_space_fit_plot)
draw.register(MimoRealization, mimo_realization_plot)
draw.register(DelayComparison, delay_comparison_plot)
draw.register(OutputErrorFit, fit_plot)
draw.register(DelayedStateSpace, system_plot)
draw.register(DelayRobustness, delay_robustness_plot)
draw.register(DelayScan, delay_plot)
draw.register(TrackHistory, track_plot)
draw.register(FRFComparison, comparison_plot)
draw.register(FRFFit, frf_fit_plot)
draw.register(ImpulseEstimate, impulse_estimate_plot)
draw.register(ImpulseResponse, impulse_plot)
draw.register(Margins, margins_plot)
draw.register(MeasuredFRF, frf_plot)
draw.register(OrderScan, order_plot)
draw.register(PIDComparison, pid_comparison_plot)
draw.register(Prediction, prediction_plot)
draw.register(ProcessModel, process_model_plot)
draw.register(Realization, singular_value_plot)
draw.register(Record, record_plot)
draw.register(ResidualAnalysis, residual_plot)
draw.register(RobustnessCheck, robustness_plot)
draw.register(StepResponse, step_plot)
draw.register(UncertaintyBound, uncertainty_plot)
draw.register(ValveTruth, truth_plot)
