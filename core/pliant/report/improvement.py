"""The steps from a model to a better one as a document: the falling error first, then the numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pliant.diagnosis.bands import Bands
from pliant.diagnosis.steps import Improvement, Step, change_in_words
from pliant.evidence.comparison import compare
from pliant.evidence.excess import Excess
from pliant.formatting import listed, number, output_unit, plural, whole_percent
from pliant.measurements.floors import Floor
from pliant.records.measurement import Measurement
from pliant.registry.discovery import Registry
from pliant.report.answers import errors_text, improvement_answers
from pliant.report.comparison_charts import MOST, runs_chart
from pliant.report.document import (
    Column,
    Document,
    Drawn,
    Picture,
    Table,
    Warned,
    as_json,
    brief_table,
    capital,
    drawn,
    page_table,
    section,
)
from pliant.report.evidence_view import Compared
from pliant.report.fitted import (
    doubtful,
    errors_json,
    floors_json,
    implausible_text,
    next_run_json,
    parameters_brief,
    parameters_json,
    parameters_table,
    warned,
)
from pliant.report.improvement_charts import MOST_OUTPUTS, steps_chart
from pliant.report.learned import learned_json, learned_section
from pliant.report.posterior import (
    WIDE,
    bands_json,
    bands_words,
    fitted_posterior_json,
    posterior_words,
    shares_brief,
    shares_table,
)

MOST_IN_A_ROW = 3  # outputs that fit next to each other into eighty characters
Placed = tuple[int, Step]
NamedFloor = tuple[str, Floor]

STEP_COLUMNS: tuple[Column[Placed], ...] = (
    Column("1.added", head="step", brief="step", text=lambda placed: _title(placed)),
    Column("1.stands_for"),
    Column("1.cause"),
    Column("1.why"),
    Column(lambda placed: errors_json(placed[1].locked), "heldout"),
    Column("1.locked.over_floor", "rmse_over_floor"),
    Column("1.locked_se", "rmse_over_floor_se"),
    Column("1.unseen.over_floor", "unseen_rmse_over_floor"),
    Column("1.training.over_floor", "training_rmse_over_floor"),
    Column(lambda s: [effect.canonical() for effect in s[1].effects], "effects"),
)
FLOOR_COLUMNS: tuple[Column[NamedFloor], ...] = (
    Column("0", head="output", show=lambda name: output_unit(name).axis),
    Column("1.value", head="floor", show=3, unit=lambda f: output_unit(f[0])),
    Column("1.se", head="standard error", show=2, unit=lambda f: output_unit(f[0])),
    Column("1.source", head="from"),
)


def improvement_document(
    title: str,
    measurement: Measurement,
    improvement: Improvement,
    registry: Registry,
    asked: Sequence[str] = (),
) -> Document:
    """Return the document of `pliant improve`; `asked` are effects requested by name."""
    doubts = [] if improvement.final is None else doubtful(improvement.final.uncertainty)
    return Document(
        kind="Pliant: a better model, step by step",
        title=title,
        sentence=f"{summary(improvement)} {improvement.reason}",
        data=improvement_json(improvement, measurement),
        brief=_brief(improvement, measurement),
        answers=improvement_answers(improvement),
        warnings=(*map(Warned, doubts), *warned(registry, improvement.remarks, asked)),
        draw=lambda: _drawn(improvement, measurement),
        footer=f"Measurement: {measurement.source or 'given in memory'}",
    )


def improvement_json(improvement: Improvement, measurement: Measurement) -> dict[str, Any]:
    """Return the keys of docs/extend_and_improve.md."""
    names = [run.name for run in measurement.runs]
    final = improvement.final
    return {
        "steps": [as_json(STEP_COLUMNS, placed) for placed in enumerate(improvement.steps, start=1)],
        "stop": improvement.stop,
        "reason": improvement.reason,
        "named": [kind for step in improvement.steps if step.cause == "named" for kind in step.added],
        "locked_runs": [names[k] for k in improvement.locked.runs],
        "unseen_runs": [names[k] for k in improvement.locked.unseen],
        "noise_floor": floors_json(improvement.floors),
        "judged": improvement.judged,
        "learned": learned_json(improvement.learned),
        "parameters": {} if final is None else parameters_json(final.uncertainty, final.values),
        "posterior": None if final is None else fitted_posterior_json(final),
        "band": None if improvement.bands is None else bands_json(*_judged_band(improvement, measurement)),
        "next_experiment": next_run_json(improvement.next_run),
        "remarks": list(improvement.remarks),
    }


def summary(improvement: Improvement) -> str:
    """Return the outcome in one sentence."""
    first, last = improvement.steps[0].locked, improvement.steps[-1].locked
    on = "runs that were held out" if improvement.locked.runs else improvement.scored_on
    if len(improvement.steps) == 1:
        judged = np.isfinite(first.over_floor)
        size = f"{number(first.over_floor, 3)} times the noise" if judged else errors_text(first.rmse, {})
        return f"No effect was added: the error on {on} is {size}."
    kinds = listed([step.named for step in improvement.steps if step.added])
    verb = "falls" if last.over_floor < first.over_floor else "goes"
    change = change_in_words(first, last, improvement.steps[-1].locked_se)
    fall = f"With {kinds} the error on {on} {verb} {change}."
    return " ".join(filter(None, (fall, causes(improvement), *doubts(improvement))))


def doubts(improvement: Improvement) -> list[str]:
    """Return doubts that the added effects explain everything: the remaining error, and implausible values."""
    last = improvement.steps[-1]
    left = Excess(last.locked.over_floor, last.locked_se)
    said = []
    if left.ratio > WIDE and not left.small:
        said.append(
            f"{number(left.ratio, 2)} times the noise is left: none of these explains all of the error."
        )
    if improvement.final is not None:
        estimates = improvement.final.uncertainty.estimates
        said += [implausible_text(one) for one in estimates if not (one.plausible or one.simpler)]
    return said


def causes(improvement: Improvement) -> str:
    """Return which of the steps a verdict names as the cause, if any cause is open."""
    steps = [step for step in improvement.steps if step.added and step.learned is None]
    unnamed = [step for step in steps if step.cause != "named"]
    if not unnamed:
        return ""
    named = [kind for step in steps if step.cause == "named" for kind in step.added]
    known = f"Named as causes: {listed(named)}" if named else "Nothing is named as the cause"
    return "; ".join([known, *map(_open_cause, unnamed)]) + "."


def _open_cause(step: Step) -> str:
    others = [kind for kind in step.stands_for if kind not in step.added]
    if others:
        return f"{listed(step.added)} cannot be distinguished here from {listed(others)}"
    return f"{listed(step.added)} predicts better, its cause is open"


def origin(improvement: Improvement, cited: str) -> str:
    """Return the origin of the values of the new study."""
    aside = (
        f"{plural(len(improvement.locked.runs), 'run')} held out"
        if improvement.locked.runs
        else "no run held out"
    )
    return f"fitted to {cited} by 'pliant improve', {aside}"


def stands_for(step: Step) -> str:
    """Return an addition to the comment on an effect: its alternatives, or that the cause is open."""
    if not step.stands_for:
        return "; predicts better, the cause is open" if step.cause == "open" else ""
    return f"; stands for one of {', '.join(step.stands_for)}, which these data do not distinguish"


def _title(placed: Placed) -> str:
    place, step = placed
    return f"{place}  {'+ ' + step.named if step.added else 'as it was'}"


def _ratio(step: Step) -> str:
    return str(Excess(step.locked.over_floor, step.locked_se)) if np.isfinite(step.locked.over_floor) else "–"


def _brief(improvement: Improvement, measurement: Measurement) -> tuple[Table | str, ...]:
    if improvement.final is None:
        return (*_whys(improvement), steps_brief(improvement))
    shares = shares_brief(improvement.final)
    fitted = (parameters_brief(improvement.final.uncertainty), *([shares] if shares else []))
    return (*_whys(improvement), steps_brief(improvement), *fitted, *_how_sure(improvement, measurement))


def _how_sure(improvement: Improvement, measurement: Measurement) -> list[str]:
    """Return what the data do not determine of the last model, and the coverage of its band."""
    if improvement.final is None or improvement.bands is None:
        return []
    of = "runs that were held out" if improvement.locked.runs else "the runs that were fitted"
    held = bands_words(*_judged_band(improvement, measurement), of, improvement.steps[-1].locked.over_floor)
    return [*posterior_words(improvement.final), *([held] if held else [])]


def _judged_band(improvement: Improvement, measurement: Measurement) -> tuple[Bands, Measurement]:
    """Return the band on the held-out runs, or on all runs without these."""
    assert improvement.bands is not None
    chosen = improvement.locked.runs or tuple(range(len(measurement.runs)))
    aside = replace(measurement, runs=tuple(measurement.runs[k] for k in chosen))
    return improvement.bands.select_runs(chosen), aside


def _whys(improvement: Improvement) -> list[str]:
    """Return the reason for each step."""
    named = (f"+ {step.named}: " if step.added else "" for step in improvement.steps)
    return [
        f"{place}  {added}{step.why}"
        for place, (added, step) in enumerate(zip(named, improvement.steps, strict=True), 1)
    ]


def step_columns(improvement: Improvement) -> tuple[Column[Placed], ...]:
    """Return the columns of the steps: those of JSON, and errors on the held-out runs by output, over the noise."""

    def error(name: str) -> Column[Placed]:
        value, unit = (lambda placed: placed[1].locked.rmse.get(name, np.nan)), output_unit(name)
        return Column(value, head=f"rms {unit.axis}", brief=unit.label, show=3, unit=lambda _: unit)

    ratio: Column[Placed] = Column(
        "1.locked.over_floor", "", "in floors", "over the noise", text=lambda placed: _ratio(placed[1])
    )
    training: Column[Placed] = Column("1.training.over_floor", "", "training, left out", show=3)
    return (*STEP_COLUMNS, *map(error, improvement.steps[0].locked.rmse), ratio, training)


def steps_brief(improvement: Improvement) -> Table:
    """Return errors on the held-out runs, a step a row; if these do not fit into a row, a step a column."""
    table, names = (
        brief_table(step_columns(improvement), list(enumerate(improvement.steps, start=1))),
        list(improvement.steps[0].locked.rmse),
    )
    known = {name: floor.value for name, floor in improvement.floors.items() if floor.value > 0.0}
    floors = (output_unit(name).text(known[name], 3) if name in known else "–" for name in names)
    head = [f"error on {improvement.scored_on}", *table.head[1:]]
    rows = [*table.rows, ["noise floor", *floors, "1" if all(name in known for name in names) else "–"]]
    if len(names) > MOST_IN_A_ROW:
        steps = [str(place) for place in range(1, len(rows))]
        first, *labels = head
        cells = zip(*(row[1:] for row in rows), strict=True)
        rows = [[label, *of_step] for label, of_step in zip(labels, cells, strict=True)]
        head = [first, *steps, "noise floor"]
    return Table("", head, rows)


def _drawn(improvement: Improvement, measurement: Measurement) -> Drawn:
    data = (
        "runs that were held out before anything was looked at"
        if improvement.locked.runs
        else improvement.scored_on
    )
    most = f" Shown: the {MOST_OUTPUTS} outputs farthest above their noise."
    caption = (
        f"Error on {data}, after each step. Bars: standard error, of few runs and of the floor; grey band: twice that "
        "of the floor. Dots: training runs, each left out of the fit. The dashed line is what the bench's own "
        f"scatter leaves to no model.{most if len(improvement.floors) > MOST_OUTPUTS else ''}"
    )
    hero = Picture("steps", caption, steps_chart(improvement))
    title = "Step by step"
    steps = page_table(
        title, step_columns(improvement), list(enumerate(improvement.steps, start=1)), numeric=2
    )
    note = "Fitted to the training runs only. Intervals: profile of the error."
    final = improvement.final
    added = None if final is None else parameters_table(final.uncertainty, "What was added", note)
    note = "Of all runs, as the residuals of the last model show it."
    floors = page_table("Noise floor", FLOOR_COLUMNS, list(improvement.floors.items()), note)
    return drawn(
        hero,
        section(title, steps, text=(*_whys(improvement), f"Why it stopped: {improvement.reason}"), open=True),
        section("What was added", added),
        learned_section(improvement.learned),
        section(
            "How sure the prediction is",
            _band_picture(improvement, measurement),
            None if final is None else shares_table(final),
            text=_how_sure(improvement, measurement),
        ),
        section("Noise floor", floors),
    )


def _band_picture(improvement: Improvement, measurement: Measurement) -> Picture | None:
    """Draw the band over the held-out runs, of the output that the steps changed most."""
    if improvement.bands is None:
        return None
    first, last = improvement.steps[0].locked.rmse, improvement.steps[-1].locked.rmse
    held = [name for name in last if name in improvement.bands.half_width()]
    if not held:
        return None
    output = min(held, key=lambda name: last[name] / first[name] if first[name] > 0.0 else 1.0)
    centre = improvement.bands.centre
    shown = Compared(measurement, centre, compare(measurement, centre), improvement.bands)
    names = [measurement.runs[k].name for k in improvement.locked.runs] or [
        run.name for run in measurement.runs
    ]
    which = "runs that were held out" if improvement.locked.runs else "runs that were fitted"
    cut = f" The first {MOST} of {len(names)}." if len(names) > MOST else ""
    caption = (
        f"{capital(output_unit(output).label)} in {which}, with the {whole_percent(improvement.bands.level)} "
        "band of what "
        "the last model would read there: its parameters' posterior, its laws' error bars and the noise of a reading."
        f"{cut}"
    )
    names = names[:MOST]
    return Picture("bands", caption, runs_chart(shown, output, names))
