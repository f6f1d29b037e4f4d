"""The way from a model to a better one as a document: the falling error first, then the numbers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pliant.diagnosis.improvement import Improvement, Step
from pliant.formatting import listed, number, unit_of
from pliant.measurements.floors import Floor
from pliant.records.measurement import Measurement
from pliant.registry.discovery import Registry
from pliant.report.answers import improvement_answers
from pliant.report.document import (
    Column,
    Document,
    Drawn,
    Picture,
    Table,
    Warned,
    as_json,
    brief_table,
    drawn,
    page_table,
    section,
)
from pliant.report.fitted import (
    doubtful,
    errors_json,
    floors_json,
    next_run_json,
    parameters_brief,
    parameters_json,
    parameters_table,
    warned,
)

MOST_IN_A_ROW = 3  # outputs that stand beside each other in eighty characters
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
    Column("0", head="output", show=lambda name: unit_of(name).axis),
    Column("1.value", head="floor", show=3, unit=lambda f: unit_of(f[0])),
    Column("1.se", head="standard error", show=2, unit=lambda f: unit_of(f[0])),
    Column("1.source", head="from"),
)


def improvement_document(
    title: str, measurement: Measurement, found: Improvement, registry: Registry, asked: Sequence[str] = ()
) -> Document:
    """The document of `pliant improve`; `asked` are effects that were asked for by name."""
    doubts = [] if found.final is None else doubtful(found.final.uncertainty)
    return Document(
        kind="Pliant: a better model, step by step",
        title=title,
        sentence=f"{summary(found)} {found.reason}",
        data=improvement_json(found, measurement),
        brief=_brief(found),
        answers=improvement_answers(found),
        warnings=(*map(Warned, doubts), *warned(registry, found.remarks, asked)),
        draw=lambda: _drawn(found),
        footer=f"Measurement: {measurement.source or 'given in memory'}",
    )


def improvement_json(found: Improvement, measurement: Measurement) -> dict[str, Any]:
    """The keys of docs/extend_and_improve.md."""
    names = [run.name for run in measurement.runs]
    final = found.final
    return {
        "steps": [as_json(STEP_COLUMNS, placed) for placed in enumerate(found.steps, start=1)],
        "stop": found.stop,
        "reason": found.reason,
        "named": [kind for step in found.steps if step.cause == "named" for kind in step.added],
        "locked_runs": [names[k] for k in found.locked.runs],
        "unseen_runs": [names[k] for k in found.locked.unseen],
        "noise_floor": floors_json(found.floors),
        "judged": found.judged,
        "parameters": {} if final is None else parameters_json(final.uncertainty, final.values),
        "next_experiment": next_run_json(found.next_run),
        "remarks": list(found.remarks),
    }


def summary(found: Improvement) -> str:
    """What came of it, in one sentence."""
    first, last = found.steps[0].locked, found.steps[-1].locked
    on = "runs that were put aside" if found.locked.runs else found.scored_on
    if len(found.steps) == 1:
        return f"No effect was added: the error on {on} is {number(first.over_floor, 3)} times the noise."
    kinds = listed([step.named for step in found.steps if step.added])
    verb = "falls" if last.over_floor < first.over_floor else "goes"
    now = _ratio(found.steps[-1])
    fall = f"With {kinds} the error on {on} {verb} from {first.over_floor:.2f} to {now} times the noise."
    return f"{fall} {causes(found)}".strip()


def causes(found: Improvement) -> str:
    """Which of the steps a verdict names as the cause, where any is open."""
    steps = [step for step in found.steps if step.added]
    named = [kind for step in steps if step.cause == "named" for kind in step.added]
    unnamed = [kind for step in steps if step.cause != "named" for kind in step.added]
    if not unnamed:
        return ""
    known = f"Named as causes: {listed(named)}" if named else "Nothing is named as the cause"
    return f"{known}; {listed(unnamed)} stand{'s' if len(unnamed) == 1 else ''} for what predicts as well."


def origin(found: Improvement, cited: str) -> str:
    """Where the values of the new study come from."""
    aside = f"{len(found.locked.runs)} runs put aside" if found.locked.runs else "no run put aside"
    return f"fitted to {cited} by 'pliant improve', {aside}"


def stands_for(step: Step) -> str:
    """What the comment beside an effect says more."""
    if not step.stands_for:
        return "; predicts better, the cause is open" if step.cause == "open" else ""
    return f"; stands for one of {', '.join(step.stands_for)}, which these data cannot tell apart"


def _title(placed: Placed) -> str:
    place, step = placed
    return f"{place}  {'+ ' + step.named if step.added else 'as it was'}"


def _ratio(step: Step) -> str:
    return f"{step.locked.over_floor:.2f} ± {step.locked_se:.2f}"


def _brief(found: Improvement) -> tuple[Table | str, ...]:
    fitted = () if found.final is None else (parameters_brief(found.final.uncertainty),)
    return (*_whys(found), steps_brief(found), *fitted)


def _whys(found: Improvement) -> list[str]:
    """The reason for each step."""
    named = (f"+ {step.named}: " if step.added else "" for step in found.steps)
    return [
        f"{place}  {added}{step.why}"
        for place, (added, step) in enumerate(zip(named, found.steps, strict=True), 1)
    ]


def step_columns(found: Improvement) -> tuple[Column[Placed], ...]:
    """Of the steps: what JSON has of each, its errors on the runs put aside by output, over the noise."""

    def error(name: str) -> Column[Placed]:
        value, unit = (lambda placed: placed[1].locked.rmse.get(name, np.nan)), unit_of(name)
        return Column(value, head=f"rms {unit.axis}", brief=unit.label, show=3, unit=lambda _: unit)

    ratio: Column[Placed] = Column(
        "1.locked.over_floor", "", "in floors", "over the noise", text=lambda placed: _ratio(placed[1])
    )
    training: Column[Placed] = Column("1.training.over_floor", "", "training, left out", show=3)
    return (*STEP_COLUMNS, *map(error, found.steps[0].locked.rmse), ratio, training)


def steps_brief(found: Improvement) -> Table:
    """Errors on the runs put aside, a step a row; where more is read than fits into a row, a step a column."""
    table, names = (
        brief_table(step_columns(found), list(enumerate(found.steps, start=1))),
        list(found.steps[0].locked.rmse),
    )
    floors = (unit_of(name).text(found.floors[name].value, 3) for name in names)
    head = [f"error on {found.scored_on}", *table.head[1:]]
    rows = [*table.rows, ["noise floor", *floors, "1"]]
    if len(names) > MOST_IN_A_ROW:
        steps = [str(place) for place in range(1, len(rows))]
        first, *labels = head
        cells = zip(*(row[1:] for row in rows), strict=True)
        rows = [[label, *of_step] for label, of_step in zip(labels, cells, strict=True)]
        head = [first, *steps, "noise floor"]
    return Table("", head, rows)


def _drawn(found: Improvement) -> Drawn:
    from pliant.report.figures.error_steps import MOST_OUTPUTS, error_steps

    data = "runs that were put aside before anything was looked at" if found.locked.runs else found.scored_on
    most = f" Shown: the {MOST_OUTPUTS} outputs farthest above their noise."
    caption = (
        f"Error on {data}, after each step. Bars: standard error, of few runs and of the floor; grey band: twice that "
        "of the floor. Dots: training runs, each left out of the fit. The dashed line is what the bench's own "
        f"scatter leaves to no model.{most if len(found.floors) > MOST_OUTPUTS else ''}"
    )
    hero = Picture("steps", caption, error_steps(found))
    title = "Step by step"
    steps = page_table(title, step_columns(found), list(enumerate(found.steps, start=1)), numeric=2)
    note = "Fitted to the training runs only. Intervals: profile of the error."
    final = found.final
    added = None if final is None else parameters_table(final.uncertainty, "What was added", note)
    note = "Of all runs, as the residuals of the last model show it."
    floors = page_table("Noise floor", FLOOR_COLUMNS, list(found.floors.items()), note)
    return drawn(
        hero,
        section(title, steps, text=(*_whys(found), f"Why it stopped: {found.reason}"), open=True),
        section("What was added", added),
        section("Noise floor", floors),
    )
