"""A diagnosis as one self-contained HTML page: verdict, hypotheses, what the best one changes, what stays open."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pliant import __version__
from pliant.diagnosis.diagnosis import Diagnosis
from pliant.diagnosis.table import Kinds
from pliant.diagnosis.words import headline, named, why
from pliant.formatting import listed, number, unit_of
from pliant.records.measurement import Measurement
from pliant.registry.discovery import Registry
from pliant.report.diagnosis_reading import Diagnosed
from pliant.report.diagnosis_tables import (
    Notes,
    classes_table,
    dependence_table,
    detectable_table,
    hypotheses_table,
    look_alikes_table,
    noise_table,
    not_excited_table,
)
from pliant.report.diagnosis_words import implausible, numbers_text
from pliant.report.document import Page, Picture, Section, Warned
from pliant.report.figures.error_depends import error_depends
from pliant.report.figures.explained_runs import explained_runs
from pliant.report.figures.hypotheses import hypotheses
from pliant.report.figures.repeats import repeats
from pliant.report.template import page_template

OUTPUTS_DRAWN = 2
MOST_PAIRS = 6
DEMANDS = {
    "missing_effect": "The effect stands out: put it into the study with pliant extend and compare again.",
    "ambiguous": "Do the run below, add it to the file and diagnose again; do not extend the study yet.",
    "nothing_missing": "Leave the model as it is for what these runs cover.",
    "unknown_effect": "Do not extend the study with an effect that does not reach the floor; measure what the error "
    "depends on.",
    "not_repeatable": "Look at the repeats below: a shift, a drift and a remounted specimen look different there.",
    "insufficient_data": "Measure what stands below, add it to the file and ask again.",
}


# Verdicts whose demand is the next run; without one, more of everything.
UNDECIDED = ("ambiguous", "insufficient_data")
RECORD = "Record other rates, holds, loads, orientations, each twice, and diagnose again; do not extend the study yet."


def diagnosis_page(title: str, measurement: Measurement, found: Diagnosis, registry: Registry) -> Page:
    """Draw and write the page. The same diagnosis gives the same bytes.

    Args:
        title: the study's name.
        measurement: what was diagnosed.
        found: what came of it.
        registry: tells what the effects are.
    """
    diagnosed = Diagnosed(measurement, found)
    notes = {kind: registry.get("effect", kind).implementation_class().notes for kind in found.excitations}
    points = [*why(found, registry), _demand(found)]
    sentence = numbers_text(found) or points[0]
    hero = Picture("hypotheses", _hero_caption(diagnosed), hypotheses(diagnosed))
    made = [
        _next(found),
        _changes(diagnosed),
        _depends(diagnosed),
        _limits(found, notes),
        Section("Numbers", (), (hypotheses_table(diagnosed),)),
        _noise(diagnosed),
    ]
    if found.verdict == "not_repeatable":  # the repeats are the finding
        made.insert(0, made.pop())
    sections = [section for section in made if section is not None]
    text = page_template().render(
        kind=f"Pliant: which effect is missing · {title}",
        title=headline(found),
        sentence=sentence,
        points=[point for point in points if point != sentence],
        hero=hero,
        warnings=[Warned(remark) for remark in _warnings(found)],
        sections=sections,
        version=__version__,
        footer=f"Measurement: {measurement.source or 'given in memory'}. Errors are measured − model",
    )
    pictures = {p.name: p.png for p in (hero, *(p for s in sections for p in s.pictures))}
    return Page(text, pictures)


def _demand(found: Diagnosis) -> str:
    return DEMANDS[found.verdict] if found.next_run is not None or found.verdict not in UNDECIDED else RECORD


def _warnings(found: Diagnosis) -> list[str]:
    strange = [f"{text[0].upper()}{text[1:]}." for text in implausible(found, found.explained)]
    return [*strange, *found.remarks]


def _hero_caption(diagnosed: Diagnosed) -> str:
    rows = len(diagnosed.found.table.rows)
    doubt = diagnosed.found.verdict in ("not_repeatable", "insufficient_data")
    return (
        f"{'For completeness; no verdict rests on these numbers. ' if doubt else ''}"
        f"{rows} explanations were fitted to all runs with the physics in the loop. Dark: together at least 90 % "
        "probable. A good explanation brings the error on runs that it was not fitted to down to the noise floor, "
        "with few parameters; a lower error with more parameters need not be more probable."
    )


def _next(found: Diagnosis) -> Section | None:
    step = found.next_run
    if step is None:
        return None
    text = [f"{step.run[0].upper()}{step.run[1:]} ({step.minutes:g} min).", f"Why: {step.why}."]
    if step.separates:
        text.append(f"One such run would tell {_separated(step.separates)}.")
    title = "What to measure next" if found.verdict != "missing_effect" else "To be surer still"
    return Section(title, text=tuple(text))


def _separated(pairs: Sequence[tuple[Kinds, Kinds]]) -> str:
    """Pairs in words, those that share their first together."""
    every = list(dict.fromkeys(kinds for pair in pairs for kinds in pair))
    if len(every) > 2 and len(pairs) == len(every) * (len(every) - 1) // 2:
        return f"{listed([named(kinds) for kinds in every])} from one another"
    if len(pairs) > MOST_PAIRS:
        return f"{len(pairs)} of the {len(every) * (len(every) - 1) // 2} pairs of these explanations apart"
    others: dict[Kinds, list[str]] = {}
    for a, b in pairs:
        others.setdefault(a, []).append(named(b))
    return "; ".join(f"{named(a)} from {listed(names)}" for a, names in others.items())


def _changes(diagnosed: Diagnosed) -> Section:
    pictures = [
        Picture(f"changes_{k + 1}", _changes_caption(diagnosed, output), explained_runs(diagnosed, output))
        for k, output in enumerate(diagnosed.outputs_by_gain()[:OUTPUTS_DRAWN])
    ]
    names = " or ".join(named(kinds) for kinds in diagnosed.explanations)
    title = {
        "missing_effect": f"What {names} changes",
        "ambiguous": f"What {names} would change",
        "unknown_effect": f"The most probable in the list, {names}, does not do it",
    }.get(diagnosed.found.verdict, f"What {names} would change")
    return Section(title if names else "The model in its worst runs", tuple(pictures))


def _changes_caption(diagnosed: Diagnosed, output: str) -> str:
    label = unit_of(output).label
    floor = diagnosed.floor(output)
    band = f" over ± 2 noise floors (one is {unit_of(output).text(floor, 2)})" if np.isfinite(floor) else ""
    which = (
        "the runs in which the explanation takes away most of the error, one of each condition"
        if diagnosed.explanations
        else "the runs in which the model errs most, one of each condition"
    )
    return (
        f"{label[0].upper()}{label[1:]} in {which}: in time, the error (measured − model){band}, and the loop over the "
        "input."
    )


def _depends(diagnosed: Diagnosed) -> Section | None:
    output = diagnosed.outputs_by_gain()[0]
    png = error_depends(diagnosed, output)
    table = dependence_table(diagnosed)
    if png is None:
        return None
    caption = (
        f"Mean error in {unit_of(output).label} against the circumstances that told most of it. Bars: 95 % under "
        "noise; filled: more than noise, corrected for looking at many places. An explanation that is right flattens "
        "all of them, not only one."
    )
    note = "" if table is not None else "The error that is left depends on nothing that was recorded."
    return Section(
        "What the error depends on", (Picture("depends", caption, png),), (table,) if table else (), note
    )


def _repeating(slip: float) -> str:
    if slip < 1.05:
        return "Runs with the same inputs scatter no more than readings within a run: the bench repeats."
    return f"Runs with the same inputs scatter {number(slip, 2)} times as much as readings within a run."


def _limits(found: Diagnosis, notes: Notes) -> Section:
    made = (
        not_excited_table(found),
        classes_table(found),
        look_alikes_table(found, notes),
        detectable_table(found),
    )
    asked, silent = len(found.excitations), len(found.not_excited)
    text = [f"These runs excite {asked - silent} of the {asked} effects that were asked."]
    if not found.indistinguishable:
        text.append("Under them no two of these look alike.")
    return Section(
        "What these runs could not show",
        (),
        tuple(table for table in made if table is not None),
        text=(" ".join(text),),
    )


def _noise(diagnosed: Diagnosed) -> Section:
    found = diagnosed.found
    output = diagnosed.outputs_by_gain()[0]
    png = repeats(diagnosed, output)
    pictures: tuple[Picture, ...] = ()
    if png is not None:
        caption = (
            f"Repeats in {unit_of(output).label}, each less their mean. The band is ± 2 times the noise within a run: "
            "runs that leave it as a whole have moved between one another."
        )
        pictures = (Picture("repeats", caption, png),)
    text = [
        f"{found.table.n_readings} readings, worth {found.noise.n_effective:.0f} independent ones: neighbours in time "
        "share their noise. All probabilities rest on the smaller number."
    ]
    if png is not None:
        text.append(_repeating(found.noise.slip))
    else:
        text.append("No run has the same inputs as another, so that nobody knows whether the bench repeats.")
    if not found.noise.judged:
        text.append(
            "The floor comes from neighbouring readings only. Slow noise and offsets between runs are invisible to it: "
            "an error above it need not be the model's, and “an effect outside the list” cannot be judged."
        )
    return Section("Noise", pictures, (noise_table(found),), text=tuple(text))
