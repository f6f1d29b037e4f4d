"""One picture of each kind of record on axes of the caller's, or on new ones: for notebooks and papers."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pliant.diagnosis.diagnosis import Diagnosis
from pliant.diagnosis.steps import Improvement
from pliant.formatting import actuation_unit, deformation_unit, display_unit, effort_unit, number, unit_of
from pliant.pipeline.segments import DesignStages
from pliant.pipeline.study import StudyRun
from pliant.records.design import Array
from pliant.records.fem import TRUSTED, ModuleData
from pliant.records.measurement import Measurement
from pliant.records.search import SearchResult
from pliant.report.document import Picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes

RUNS_DRAWN, LEVELS, BARS = 6, 5, 8


def _on(ax: Axes | None, x: str, y: str, title: str = "") -> Axes:
    """The caller's axes, or new ones, labelled."""
    if ax is None:
        from matplotlib import pyplot

        ax = pyplot.subplots(layout="constrained")[1]
    ax.set(xlabel=x, ylabel=y, title=title)
    return ax


def image(picture: Picture, ax: Axes | None = None) -> Axes:
    """A page's picture."""
    from PIL import Image

    axes = _on(ax, "", "")
    axes.imshow(np.asarray(Image.open(io.BytesIO(picture.png.tobytes()))))
    axes.set_axis_off()
    return axes


def backbones(run: StudyRun, ax: Axes | None = None) -> Axes:
    """The settled chain of each engine from the side: world x over z."""
    unit = display_unit("m")
    axes = _on(ax, f"x ({unit.symbol})", f"z ({unit.symbol})", run.study.name)
    for engine in run.engines:
        if engine.result is not None:
            x, _, z = engine.result.final.markers_m.T * unit.factor
            axes.plot(x, z, marker="o", markersize=3, label=engine.kind)
    axes.set_aspect("equal", adjustable="datalim")
    axes.legend()
    return axes


def laws(designs: Sequence[DesignStages], ax: Axes | None = None) -> Axes:
    """The first design's law over its domain at several actuations, with the data that it was fitted to."""
    stage = designs[0].law
    law, data = stage.law, stage.data
    pressure, angle, effort = actuation_unit(law.actuation_name), deformation_unit(law), effort_unit(law)
    coordinate = "extension" if law.joint == "prismatic" else "joint angle"
    axes = _on(ax, f"{coordinate} ({angle.symbol})", f"effort ({effort.symbol})")
    low, high = (side if np.isfinite(side) else 0.0 for side in law.domain.actuation)
    left, right = (
        side if np.isfinite(side) else k for side, k in zip(law.domain.deformation[0], (0, 1), strict=True)
    )
    u = np.linspace(left, right, 101)
    deformation = np.zeros((len(u), len(law.axes)))
    deformation[:, law.axes.index("y") if "y" in law.axes else 0] = u
    for level in np.linspace(low, high, LEVELS):
        tau = law.evaluate(np.full(len(u), level), deformation).tau
        main = tau[:, law.axes.index("y") if "y" in law.axes else 0]
        axes.plot(u * angle.factor, main * effort.factor, label=pressure.text(float(level), 3))
    if data is not None:
        axes.plot(
            data.angle_rad * angle.factor, data.moment_n_m * effort.factor, "k.", markersize=3, label="data"
        )
    axes.legend()
    return axes


def module_data(data: ModuleData, ax: Axes | None = None) -> Axes:
    """Solved states: effort over the main axis' coordinate, coloured by the actuation."""
    main = data.axes.index("y") if "y" in data.axes else 0
    angle, effort, pressure = deformation_unit(data), effort_unit(data), actuation_unit(data.actuation_name)
    axes = _on(ax, f"deformation ({angle.symbol})", f"effort ({effort.symbol})")
    kept = np.isin(data.status, TRUSTED)
    dots = axes.scatter(
        data.deformation[kept, main] * angle.factor,
        data.tau[kept, main] * effort.factor,
        c=data.actuation[kept] * pressure.factor,
        s=12,
    )
    axes.figure.colorbar(dots, ax=axes, label=f"actuation ({pressure.symbol})")
    return axes


def readings(measurement: Measurement, ax: Axes | None = None) -> Axes:
    """The first output over time, a line per run; over the first input where there is no time."""
    return _runs(measurement, [{} for _ in measurement.runs], ax)


def measured(
    measurement: Measurement, predicted: Sequence[Mapping[str, Array]], ax: Axes | None = None
) -> Axes:
    """The first output as measured (dots) and as predicted (lines)."""
    return _runs(measurement, predicted, ax)


def _runs(measurement: Measurement, predicted: Sequence[Mapping[str, Array]], ax: Axes | None) -> Axes:
    shown = [name for name in measurement.outputs if any(name in model for model in predicted)]
    output = (shown or list(measurement.outputs))[0]
    timed = all(run.history.time_s is not None for run in measurement.runs)
    driver = "time_s" if timed else next(iter(measurement.runs[0].history.actuation))
    x_unit, y_unit = unit_of(driver), unit_of(output)
    axes = _on(ax, x_unit.axis, y_unit.axis)
    for run, model in list(zip(measurement.runs, predicted, strict=True))[:RUNS_DRAWN]:
        x = (run.history.time_s if timed else run.input(driver)) * x_unit.factor  # type: ignore[operator]
        (dots,) = axes.plot(x, run.outputs[output] * y_unit.factor, ".", markersize=3, label=run.name)
        if output in model:
            axes.plot(x, model[output] * y_unit.factor, color=dots.get_color())
    axes.legend()
    return axes


def hypotheses(found: Diagnosis, ax: Axes | None = None) -> Axes:
    """Probabilities of the leading hypotheses."""
    leading = list(found.judgement.probability.items())[:BARS][::-1]
    axes = _on(ax, "probability", "", found.judgement.sentence)
    names = [" + ".join(kinds) or "nothing missing" for kinds, _ in leading]
    axes.barh(names, [share for _, share in leading])
    axes.set_xlim(0.0, 1.0)
    return axes


def steps(found: Improvement, ax: Axes | None = None) -> Axes:
    """The error over the noise floor after each step, on what nothing was fitted to."""
    axes = _on(ax, "", f"error over the noise floor, {found.scored_on}")
    ratios = [step.locked.over_floor for step in found.steps]
    axes.errorbar(
        range(len(ratios)), ratios, yerr=[step.locked_se for step in found.steps], marker="o", capsize=3
    )
    axes.axhline(1.0, color="0.5", linewidth=0.8)
    labels = [f"+ {step.named}" if step.added else "as it was" for step in found.steps]
    axes.set_xticks(range(len(labels)), labels)
    axes.set_ylim(bottom=0.0)
    return axes


def history(found: SearchResult, ax: Axes | None = None) -> Axes:
    """The first objective of every candidate in order, and the best so far."""
    sign = -1.0 if found.maximised[0] else 1.0
    axes = _on(ax, "candidate", found.objectives[0], f"best {number(sign * _best(found))}")
    axes.plot(sign * found.history.objectives[:, 0], ".", markersize=3)
    axes.plot(sign * found.history.best_so_far(), label="best so far")
    axes.legend()
    return axes


def _best(found: SearchResult) -> Any:
    known = found.history.best_so_far()
    return known[-1] if len(known) else np.nan
