"""The way from a model to a better one as one self-contained page: the falling error first, then the numbers."""

from __future__ import annotations

from pliant import __version__
from pliant.diagnosis.improvement import Improvement, summary
from pliant.formatting import number, unit_of
from pliant.report.diagnosis_words import estimate_cells
from pliant.report.document import Page, Picture, Section, Table, Warned
from pliant.report.figures.error_steps import MOST_OUTPUTS, error_steps
from pliant.report.template import page_template


def improvement_page(title: str, source: str, found: Improvement) -> Page:
    """Draw and write the page. The same result gives the same bytes."""
    hero = Picture("steps", _caption(found), error_steps(found, [step.why for step in found.steps]))
    sections = [Section("Step by step", tables=(_steps(found),), note=f"Why it stopped: {found.reason}")]
    if found.final is not None:
        sections.append(Section("What was added", tables=(_parameters(found),)))
    sections.append(Section("Noise floor", tables=(_floors(found),)))
    text = page_template().render(
        kind="Pliant: a better model, step by step",
        title=title,
        sentence=f"{summary(found)} {found.reason}",
        hero=hero,
        warnings=[Warned(remark) for remark in found.remarks],
        sections=sections,
        version=__version__,
        footer=f"Measurement: {source or 'given in memory'}",
    )
    return Page(text, {hero.name: hero.png})


def _caption(found: Improvement) -> str:
    data = "runs that were put aside before anything was looked at" if found.locked.runs else found.scored_on
    drawn = (
        f" Shown: the {MOST_OUTPUTS} outputs farthest above their noise."
        if len(found.floors) > MOST_OUTPUTS
        else ""
    )
    return (
        f"Error on {data}, after each step. Bars: standard error, of few runs and of the floor; grey band: twice that "
        "of the floor. Dots: training runs, each left out of the fit. The dashed line is what the bench's own "
        f"scatter leaves to no model.{drawn}"
    )


def _steps(found: Improvement) -> Table:
    names = list(found.steps[0].locked.rmse)
    rows = []
    for place, step in enumerate(found.steps, start=1):
        rows.append(
            [
                f"{place}  {'+ ' + step.named if step.added else 'as it was'}",
                step.why,
                *(number(step.locked.rmse[name] * unit_of(name).factor, 3) for name in names),
                f"{step.locked.over_floor:.2f} ± {step.locked_se:.2f}",
                number(step.training.over_floor, 3),
            ]
        )
    head = [
        "step",
        "why",
        *(f"rms {unit_of(name).axis}" for name in names),
        "in floors",
        "training, left out",
    ]
    return Table("Step by step", head, rows, numeric=2)


def _parameters(found: Improvement) -> Table:
    assert found.final is not None
    rows = [[*estimate_cells(e), ", ".join(e.doubts)] for e in found.final.uncertainty.estimates]
    head = ["parameter", "value", "sd", "90 % interval", "unit", ""]
    return Table(
        "What was added", head, rows, "Fitted to the training runs only. Intervals: profile of the error."
    )


def _floors(found: Improvement) -> Table:
    rows = []
    for name, floor in found.floors.items():
        words = unit_of(name)
        rows.append(
            [
                words.axis,
                number(floor.value * words.factor, 3),
                number(floor.se * words.factor, 2),
                floor.source,
            ]
        )
    note = "Of all runs, as the residuals of the last model show it."
    return Table("Noise floor", ["output", "floor", "standard error", "from"], rows, note)
