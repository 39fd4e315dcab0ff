"""The figures of a report with their texts, for pages and for files."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import control as ct
import numpy as np
from markupsafe import Markup
from matplotlib.figure import Figure

from .. import plots
from .._facts import facts
from ..data import MeasuredFRF, Record, StepResponse
from ..delayed import DelayedStateSpace
from ..errors import DataError, NoStepError
from ..frequency.comparison import FRFComparison
from ..identification.campaign.campaign import Campaign
from ..identification.joint.result import JointFit
from ..identification.output_error.result import OutputErrorFit
from ..identification.realization.delay_scan_result import DelayScan
from ..identification.realization.result import Realization
from ..identification.state_space_fit.result import StateSpaceFit
from ..identification.step.steps import unit_step
from ..io.atomic import replaced_when_complete
from ..plots.fits import MOST_BESIDE, each_record_rows, evidence_height
from ..results import ModelFit
from .svg import inline_svg, laid_out, missing_glyphs_allowed

MOST_DRAWN = 60
"""Largest number of step responses in one plot."""
_WORDS = facts("report/figures.toml")
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

    @property
    def svg(self) -> Markup:
        """The figure for a page, which does not escape it."""
        described = f"{self.title}. {self.caption}"
        return Markup(inline_svg(self.figure, self.key.replace("_", "-"), described))

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


def sketch(
    name: str,
    plot: Callable[..., Any],
    *results: Any,
    size: tuple[float, float] = (6.2, 4.0),
    words: Mapping[str, str] | None = None,
    key: str | None = None,
    **options: Any,
) -> Sketch:
    """Make a figure by a plot function, with the title and caption of a row of `figures.toml`."""
    title, caption = (_WORDS[name][part].format(**(words or {})) for part in ("title", "caption"))
    draw = lambda figure: plot(*results, ax=figure, **options)  # noqa: E731
    return Sketch(key or name.partition(".")[0], title, caption, draw, size)


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
        words = {"linear": _LINEAR * linear}
        sketches.append(sketch("onset", plots.onset_plot, step, system, words=words))
    sketches += fit_sketches(system, step)
    given = () if system.fit is None else system.fit.records
    several = [one for one in given if not np.isnan(one.input).any()]
    if len(several) > 1:
        sketches.append(_each_record(system, several, len(several) - MOST_BESIDE))
    sketches.append(sketch("record", plots.record_plot, record))
    return sketches + frf_sketches([system], frf, comparison)


def fit_sketches(system: DelayedStateSpace, step: StepResponse | None) -> list[Sketch]:
    """List the figures about how a model was found."""
    fit = system.fit
    sketches = []
    if isinstance(fit, OutputErrorFit):
        size = (6.2, 3.6 + evidence_height(fit))
        sketches.append(sketch("fit", plots.fit_plot, fit, size=size))
        if (models := fit.plausible_models) is not None:
            sketches.append(sketch("plausible", plots.plausible_plot, models, size=(6.2, 6.4)))
    elif step is not None:
        sketches.append(sketch("step", plots.step_plot, step, system))
    if isinstance(fit, StateSpaceFit) and fit.checks:
        plot, size = plots.state_space_fit_plot, (6.2, 5.4)
        drifts = any(flag.code == "drift" for flag in fit.flags)
        drift = ", both without the drift of the remarks" if drifts else ""
        for i, label in enumerate(fit.records[0].output_labels):
            words, key = {"label": label, "drift": drift}, f"output_{i}"
            sketches.append(sketch("output", plot, fit, output=i, size=size, words=words, key=key))
    if isinstance(fit, DelayScan):
        sketches.append(sketch("delay", plots.delay_plot, fit))
        sketches.append(sketch("impulse", plots.impulse_plot, fit.impulse, system))
    if isinstance(fit, DelayScan | Realization):
        sketches.append(sketch("singular_values", plots.singular_value_plot, fit))
    return sketches


def _each_record(system: DelayedStateSpace, records: Sequence[Record], more: int) -> Sketch:
    words = {"more": f" {more} more records are not shown." if more > 0 else ""}
    size = (6.2, 0.6 + 1.7 * each_record_rows(len(records)))
    return sketch("each_record", plots.each_record_plot, system, records, size=size, words=words)


def frf_sketches(
    systems: list[Any],
    frf: ct.FrequencyResponseData | None,
    comparison: FRFComparison | None = None,
) -> list[Sketch]:
    """List the frequency-domain figures: of models alone, or with a measurement."""
    if not all(system.issiso() for system in systems):
        return []  # drawn one channel at a time
    if frf is None:
        return [sketch("frf.model", plots.frf_plot, systems, size=(6.2, 4.8))]
    tall = 5.4 if isinstance(frf, MeasuredFRF) and frf.coherence is not None else 4.8
    fitted = any(isinstance(getattr(system, "fit", None), JointFit) for system in systems)
    name = "frf.joint" if fitted else "frf"
    sketches = [sketch(name, plots.frf_plot, [frf, *systems], size=(6.2, tall))]
    if comparison is not None:
        sketches.append(sketch("frf_error", plots.comparison_plot, comparison, size=(6.2, 4.6)))
    return sketches


def campaign_sketches(campaign: Campaign, *, truth: float | None = None) -> list[Sketch]:
    """List the figures of a campaign, including those of the final model and the best record."""
    count = len(campaign.good)
    tall = min(max(0.27 * count + 1.6, 3.4), 8.0) if count <= 24 else 4.2
    sketches = [sketch("delays", plots.campaign_plot, campaign, truth=truth, size=(6.2, tall))]
    system = campaign.system
    drawn = _records_of(campaign, MOST_DRAWN) if _from_a_step(system.fit) else []
    steps = [step for step in map(_step_of, drawn) if step is not None]
    if steps:
        sketches.append(sketch("onset.campaign", plots.onset_plot, steps, system))
        sketches.append(sketch("step.campaign", plots.step_plot, steps, system))
    records = [one for one in _records_of(campaign, MOST_BESIDE) if not one.n_missing]
    if len(records) > 1 and system.issiso():
        sketches.append(_each_record(system, records, count - len(records)))
    sketches += [one for one in fit_sketches(system, None) if one.key != "impulse"]
    return sketches


def _from_a_step(fit: ModelFit | None) -> bool:
    """Whether there is a baseline before a single step, whose response is in every sample.

    Beside samples that only repeat the last update a model looks early, and beside the rest of the
    response to an earlier input, too small or too large.
    """
    if fit is None:
        return True
    others = {"repeats_left_out", "not_at_rest"} & {flag.code for flag in fit.flags}
    return not others and (fit.onset is None or not np.isnan(fit.onset))


def _step_of(record: Record) -> StepResponse | None:
    try:
        return unit_step(record)
    except (NoStepError, DataError):
        return None


def _records_of(campaign: Campaign, most: int) -> list[Record]:
    """Return records of a campaign that were identified, evenly spaced if there are many."""
    every = max(1, -(-len(campaign.good) // most))
    pairs = zip(campaign.rows, campaign.sources, strict=True)
    sources = [source for row, source in pairs if row.error is None][::every]
    return [one if isinstance(one, Record) else one() for one in sources]
