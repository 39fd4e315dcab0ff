"""Selection of the plot for each kind of result."""

from __future__ import annotations

from functools import singledispatch
from typing import Any

import control as ct

from .. import errors
from ..data.frf import MeasuredFRF
from ..data.step import StepResponse
from ..datasets.loading import Dataset
from ..identification.joint.result import JointFit
from ..identification.output_error.result import OutputErrorFit
from ..identification.realization.delay_scan_result import DelayScan
from ..identification.realization.result import Realization
from ..identification.several_inputs_result import SeveralInputsFit
from ..io.stored_fit import FitSummary
from .campaigns import campaign_plot, gain_plot
from .delays import delay_comparison_plot, track_plot
from .fits import fit_plot, several_inputs_plot
from .frequencies import frf_fit_plot, frf_plot, joint_fit_plot, truth_plot
from .frf_comparison import comparison_plot
from .loops import margins_plot
from .records import experiment_plot, record_plot, step_plot
from .residuals import model_comparison_plot, prediction_plot, residual_plot, state_space_fit_plot
from .responses import impulse_estimate_plot, impulse_plot, mimo_realization_plot, system_plot
from .robustness import delay_robustness_plot, plausible_plot, robustness_plot, uncertainty_plot
from .scans import delay_plot, order_plot, singular_value_plot
from .shared_docs import documented
from .tuning import hankel_plot, pid_comparison_plot, process_model_plot
from .valves.loops import loop_diagnosis_plot
from .valves.tests import valve_plan_plot, valve_plot


@singledispatch
@documented()
def draw(result: Any, **kwargs: Any) -> ct.ControlPlot:
    """Draw any result by the function for its kind.

    ``result.plot(**kwargs)`` does the same.

    Parameters
    ----------
    result : Result
        Any result of this toolbox.
    **kwargs
        Passed on to the function.

    Raises
    ------
    OptionError
        There is no plot for this kind of object.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> record = cr.bench.valve().step_record(16, rng=5)
    >>> cplt = cr.plots.draw(record)                # what record.plot() does
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


@draw.register
def _first_of_the_set(result: Dataset, **kwargs: Any) -> ct.ControlPlot:
    return draw(result.records[0] if result.records else result.frfs[0], **kwargs)


# the annotation of the first argument is the kind of result
for _plot in (
    campaign_plot, comparison_plot, delay_comparison_plot, delay_robustness_plot, experiment_plot,
    frf_fit_plot, gain_plot, hankel_plot, impulse_estimate_plot, impulse_plot, loop_diagnosis_plot,
    margins_plot, mimo_realization_plot, model_comparison_plot, order_plot, pid_comparison_plot,
    plausible_plot, prediction_plot, process_model_plot, record_plot, residual_plot,
    robustness_plot, state_space_fit_plot, system_plot, track_plot, truth_plot, uncertainty_plot,
    valve_plan_plot, valve_plot,
):  # fmt: skip
    draw.register(_plot)

# for functions with more than one kind
draw.register(OutputErrorFit, fit_plot)
draw.register(JointFit, joint_fit_plot)
draw.register(DelayScan, delay_plot)
draw.register(MeasuredFRF, frf_plot)
draw.register(Realization, singular_value_plot)
draw.register(SeveralInputsFit, several_inputs_plot)
draw.register(StepResponse, step_plot)
