"""The figures of a report with their texts, for pages and for files."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import control as ct
import numpy as np
from markupsafe import Markup
from matplotlib.figure import Figure

from .. import plots
from ..data import MeasuredFRF, Record, StepResponse
from ..delayed import DelayedStateSpace
from ..errors import DataError, NoStepError
from ..frequency.comparison import FRFComparison
from ..identification.campaign.campaign import Campaign
from ..identification.output_error.result import OutputErrorFit
from ..identification.realization.delay_scan_result import DelayScan
from ..identification.realization.result import Realization
from ..identification.state_space_fit.result import StateSpaceFit
from ..identification.step.steps import unit_step
from ..io.atomic import replaced_when_complete
from ..plots.fits import MOST_BESIDE, each_record_rows, evidence_height
from ..results import ModelFit
from .page import PageFigure
from .svg import inline_svg, laid_out, missing_glyphs_allowed

MOST_DRAWN = 60
"""Largest number of step responses in one plot."""
_LINEAR = " The model is the linear part, without the actuator."


@dataclass(frozen=True, eq=False)
class Sketch:
    """A figure that is drawn on demand.

    Attributes
    ----------
    key : str
        Short name, also of its file.
    title, caption : str
    draw : callable
        Draws into a matplotlib Figure.
    size : tuple of float
        In inches.

    Examples
    --------
    >>> from ctrl_realize.report.sketches import Sketch
    >>> def draw(figure):
    ...     figure.add_subplot(ylabel="room [°C]").plot([20.5, 21.0, 20.8])
    >>> sketch = Sketch("room", "Room", "Temperature of the day.", draw)
    >>> sketch.figure.axes[0].get_ylabel()
    'room [°C]'
    """

    key: str
    title: str
    caption: str
    draw: Callable[[Figure], Any]
    size: tuple[float, float] = (6.2, 4.0)

    @cached_property
    def figure(self) -> Figure:
        """The figure, drawn once."""
        return laid_out(self.draw, self.size)

    def on_page(self) -> PageFigure:
        """Convert it for a page."""
        key = self.key.replace("_", "-")
        svg = inline_svg(self.figure, key, f"{self.title}. {self.caption}")
        return PageFigure(key, self.title, self.caption, Markup(svg))

    def save(self, path: str | os.PathLike[str], *, dpi: float = 150) -> None:
        """Save it to a file, atomically; the extension determines the format."""
        kind = os.path.splitext(path)[1].lstrip(".").lower() or "png"
        with missing_glyphs_allowed(), replaced_when_complete(path) as temporary:
            self.figure.savefig(temporary, format=kind, dpi=dpi, facecolor="white")


def save_sketches(folder: str | os.PathLike[str], sketches: Sequence[Sketch]) -> None:
    """Save figures as PNG files in a folder, which is created if needed."""
    place = Path(folder)
    place.mkdir(exist_ok=True)
    for sketch in sketches:
        sketch.save(place / f"{sketch.key}.png")


def identification_sketches(
    system: DelayedStateSpace,
    record: Record,
    *,
    frf: ct.FrequencyResponseData | None = None,
    comparison: FRFComparison | None = None,
) -> list[Sketch]:
    """List the figures of one identification, the most important first."""
    step = _step_of(record) if _from_a_step(system.fit) else None
    sketches = []
    if step is not None:
        linear = system.fit is not None and system.fit.actuator is not None
        sketches.append(
            Sketch(
                "onset",
                "Start of the response",
                f"Dead time of the model (line) and its interval (band).{_LINEAR * linear}",
                lambda figure: plots.onset_plot(step, system, ax=figure),
            )
        )
    sketches += fit_sketches(system, step)
    given = () if system.fit is None else system.fit.records
    several = [one for one in given if not np.isnan(one.input).any()]
    if len(several) > 1:
        sketches.append(_each_record(system, several))
    sketches.append(
        Sketch(
            "record",
            "The record",
            "As measured: output above, input below.",
            lambda figure: plots.record_plot(record, ax=figure),
        )
    )
    return sketches + frf_sketches([system], frf, comparison)


def fit_sketches(system: DelayedStateSpace, step: StepResponse | None) -> list[Sketch]:
    """List the figures about how a model was found."""
    fit = system.fit
    sketches = []
    if isinstance(fit, OutputErrorFit):
        sketches.append(
            Sketch(
                "fit",
                "Data, model and residual",
                "The residual should look like noise. Below: the dead time of each structure "
                "and delay estimate; the band is the interval.",
                lambda figure: plots.fit_plot(fit, ax=figure),
                (6.2, 3.6 + evidence_height(fit)),
            )
        )
    elif step is not None:
        sketches.append(
            Sketch(
                "step",
                "Response to a unit step",
                "Measured, with the response of the model on top.",
                lambda figure: plots.step_plot(step, system, ax=figure),
            )
        )
    if isinstance(fit, StateSpaceFit) and fit.checks:
        labels = fit.records[0].output_labels
        sketches += [_output_sketch(fit, i, label) for i, label in enumerate(labels)]
    if isinstance(fit, DelayScan):
        sketches += [
            Sketch(
                "delay",
                "IAE against the delay",
                "One model for every delay; a flat minimum means that the data do not "
                "determine the delay.",
                lambda figure: plots.delay_plot(fit, ax=figure),
            ),
            Sketch(
                "impulse",
                "Impulse response",
                "Differentiated data and the realization.",
                lambda figure: plots.impulse_plot(fit.impulse, system, ax=figure),
            ),
        ]
    if isinstance(fit, DelayScan | Realization):
        sketches.append(
            Sketch(
                "singular_values",
                "Singular values of the Hankel matrix",
                "Only values above the noise level can be modelled.",
                lambda figure: plots.singular_value_plot(fit, ax=figure),
            )
        )
    return sketches


def _each_record(
    system: DelayedStateSpace, records: Sequence[Record], more: int | None = None
) -> Sketch:
    more = len(records) - MOST_BESIDE if more is None else more
    return Sketch(
        "each_record",
        "Each record beside the model",
        "The model is simulated with the input of each record; the title has its fit."
        + (f" {more} more records are not shown." if more > 0 else ""),
        lambda figure: plots.each_record_plot(system, records, ax=figure),
        (6.2, 0.6 + 1.7 * each_record_rows(len(records))),
    )


def _output_sketch(fit: StateSpaceFit, output: int, label: str) -> Sketch:
    return Sketch(
        f"output_{output}",
        f"The output {label}",
        "Measured and simulated. Below: autocorrelation of the residual, and its "
        "cross-correlation with the input.",
        lambda figure: plots.state_space_fit_plot(fit, output=output, ax=figure),
        (6.2, 5.4),
    )


def frf_sketches(
    systems: list[Any],
    frf: ct.FrequencyResponseData | None,
    comparison: FRFComparison | None = None,
    caption: str = "Measured, with the model on top. These data were not used for the fit.",
) -> list[Sketch]:
    """List the frequency-domain figures: of models alone, or with a measurement."""
    if not all(system.issiso() for system in systems):
        return []  # drawn one channel at a time
    if frf is None:
        return [
            Sketch(
                "frf",
                "Frequency response of the model",
                "Up to half the sample rate, dead time included.",
                lambda figure: plots.frf_plot(systems, ax=figure),
                (6.2, 4.8),
            )
        ]
    tall = 5.4 if isinstance(frf, MeasuredFRF) and frf.coherence is not None else 4.8
    sketches = [
        Sketch(
            "frf",
            "Frequency response",
            caption,
            lambda figure: plots.frf_plot([frf, *systems], ax=figure),
            (6.2, tall),
        )
    ]
    if comparison is not None:
        sketches.append(
            Sketch(
                "frf_error",
                "Relative error against frequency",
                "Model against measurement; the trusted band is shaded.",
                lambda figure: plots.comparison_plot(comparison, ax=figure),
                (6.2, 4.6),
            )
        )
    return sketches


def campaign_sketches(campaign: Campaign, *, truth: float | None = None) -> list[Sketch]:
    """List the figures of a campaign, including those of the final model and the best record."""
    count = len(campaign.good)
    tall = min(max(0.27 * count + 1.6, 3.4), 8.0) if count <= 24 else 4.2
    sketches = [
        Sketch(
            "delays",
            "Delay of every record",
            "Points: estimates; bars: their intervals; band: 95 % interval of the trimmed mean.",
            lambda figure: plots.campaign_plot(campaign, truth=truth, ax=figure),
            (6.2, tall),
        )
    ]
    system = campaign.system
    steps = _steps_of(campaign) if _from_a_step(system.fit) else []
    if steps:
        sketches += [
            Sketch(
                "onset",
                "Start of the response, all records",
                "Dead time of the final model (line) and its interval (band).",
                lambda figure: plots.onset_plot(steps, system, ax=figure),
            ),
            Sketch(
                "step",
                "Responses to a unit step, all records",
                "Each divided by its own step amplitude; the final model on top.",
                lambda figure: plots.step_plot(steps, system, ax=figure),
            ),
        ]
    records = [one for one in _records_of(campaign, MOST_BESIDE) if not one.n_missing]
    if len(records) > 1 and system.issiso():
        sketches.append(_each_record(system, records, count - len(records)))
    sketches += [one for one in fit_sketches(system, None) if one.key != "impulse"]
    return sketches


def _from_a_step(fit: ModelFit | None) -> bool:
    """Whether there is a baseline before a single step."""
    return fit is None or fit.onset is None or not np.isnan(fit.onset)


def _step_of(record: Record) -> StepResponse | None:
    try:
        return unit_step(record)
    except (NoStepError, DataError):
        return None


def _steps_of(campaign: Campaign) -> list[StepResponse]:
    """Return the step responses of a campaign's records, up to a limit."""
    steps = [_step_of(record) for record in _records_of(campaign, MOST_DRAWN)]
    return [step for step in steps if step is not None]


def _records_of(campaign: Campaign, most: int) -> list[Record]:
    """Return records of a campaign that were identified, evenly spaced if there are many."""
    every = max(1, -(-len(campaign.good) // most))
    pairs = zip(campaign.rows, campaign.sources, strict=True)
    sources = [source for row, source in pairs if row.system is not None][::every]
    return [one if isinstance(one, Record) else one() for one in sources]
