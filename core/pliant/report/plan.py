"""The next runs as a document: after a measurement that did not decide, or before anything is measured."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from pliant.diagnosis.classes import RunDesign
from pliant.diagnosis.next_run import RankedRun
from pliant.diagnosis.planning import RunPlan
from pliant.diagnosis.verdict import named
from pliant.experiments.planned_run import PlannedRun
from pliant.formatting import listed, plural, whole_percent
from pliant.records.measurement import Measurement
from pliant.records.remark import Rank, Remark
from pliant.registry.discovery import Registry
from pliant.report.document import Column, Document, Table, as_json, brief_table
from pliant.report.fitted import caveat, next_run_json, package_warnings

KIND = "Pliant: what to measure next"
MOST_RANKED = 6
ONE_LEFT = "One explanation is left: no further run is needed to decide."
NO_LISTED = (
    "No listed effect explains the error, so that no run can decide between them; 'pliant diagnose' reports what it "
    "depends on."
)
NONE_SHOWS = "No run of the menu shows any of these effects; list other runs under 'protocols:' in the study."
OF_EACH_ALONE = (
    "Each run alone: the yes-or-no questions that it is expected to answer per minute on the bench, and the chance "
    "that the verdict after it names the right explanation."
)
RUN_COLUMNS: tuple[Column[PlannedRun], ...] = (Column("name"), Column("words", "run"), Column("minutes"))
RANKED_COLUMNS: tuple[Column[RankedRun], ...] = (
    Column("name", brief="run"),
    Column("minutes", brief="minutes", show=lambda minutes: f"{minutes:g}"),
    Column("gain_per_minute", brief="questions a minute", show=lambda nats: f"{nats / math.log(2.0):.2f}"),
    Column("expected", brief="right after it", show=whole_percent),
)


def plan_document(
    title: str,
    measurement: Measurement,
    plan: RunPlan,
    files: Sequence[str],
    registry: Registry,
) -> Document:
    """Return the document of the runs that decide between the remaining hypotheses of a diagnosis.

    Args:
        title: the study's name.
        measurement: the diagnosed one.
        plan: the diagnosis and the runs that follow it.
        files: their protocol files; empty for runs that are not written.
        registry: the plugins, whose effects may have been left out.
    """
    found, chosen, remark = plan.diagnosis, plan.chosen, plan.remark
    written = files or [""] * len(chosen)
    lines: list[Table | str] = [found.judgement.sentence]
    if chosen:
        lines.append(brief_table(RANKED_COLUMNS, chosen[0].ranked[:MOST_RANKED], OF_EACH_ALONE))
    for one, file in zip(chosen, written, strict=True):
        lines += [f"{one.name} ({one.minutes:g} min): {one.run}", f"  {one.why}"]
        for a in dict.fromkeys(a for a, _ in one.separates):
            others = listed([named(b) for c, b in one.separates if c == a])
            lines.append(f"  expected to distinguish {named(a)} from {others}")
        lines += [f"  file   {file}"] if file else []
    none = remark or (NO_LISTED if found.verdict == "unknown_effect" else ONE_LEFT)
    return Document(
        kind=KIND,
        title=title,
        sentence="" if chosen else none,
        data={
            "data": measurement.source,
            "data_sha256": measurement.sha256,
            "verdict": found.verdict,
            "credible_set": [list(one) for one in found.judgement.credible],
            "runs": [next_run_json(one, file) for one, file in zip(chosen, written, strict=True)],
            "minutes": sum(one.minutes for one in chosen),
            "remarks": [*found.remarks, *([remark] if remark else [])],
        },
        brief=tuple(lines),
        warnings=(
            *(one for one in map(caveat, found.remarks) if one.rank == Rank.UNIT),
            *package_warnings(registry, found.remarks),
        ),
    )


def design_document(title: str, design: RunDesign, files: Sequence[str], registry: Registry) -> Document:
    """Return the fewest runs that distinguish effects, before any measurement; `files` are their protocol files.

    Without `files` the runs are named alone.
    """
    files = files or [""] * len(design.chosen)
    lines: list[Table | str] = [_signals(design)] if design.chosen else []
    for number, (k, count, file) in enumerate(zip(design.chosen, design.parts[1:], files, strict=True), 1):
        run = design.runs[k]
        lines.append(f"run {number}: {run.name} ({run.minutes:g} min): {run.words}")
        groups = f"  {plural(count, 'group')} of effects distinguished so far"
        lines.append(f"{groups}; file   {file}" if file else groups)
    whole = (
        f"{plural(len(design.chosen), 'run')}, {design.minutes:g} min: "
        f"{plural(design.parts[-1], 'group')} of {plural(len(design.snr), 'effect')}."
    )
    return Document(
        kind=KIND,
        title=title,
        sentence=whole if design.chosen else NONE_SHOWS,
        data=design_json(design, files),
        brief=tuple(lines),
        closing=(
            whole,
            *(f"not distinguished: {listed(list(part))}" for part in design.together),
            *(
                [f"shown by none of these runs: {listed(list(design.not_excited))}"]
                if design.not_excited
                else []
            ),
        )
        if design.chosen
        else (),
        warnings=package_warnings(
            registry,
            [
                Remark(f"'{kind}' was left out: {why}", left_out=kind)
                for kind, why in design.not_tried.items()
            ],
        ),
    )


def design_json(design: RunDesign, files: Sequence[str]) -> dict[str, Any]:
    """Return the keys of docs/plan_the_next_experiment.md without data."""
    menu = [
        {**as_json(RUN_COLUMNS, run), "snr": {kind: values[k] for kind, values in design.snr.items()}}
        for k, run in enumerate(design.runs)
    ]
    runs = [
        {**as_json(RUN_COLUMNS, design.runs[k]), "groups": count, "file": file}
        for k, count, file in zip(design.chosen, design.parts[1:], files, strict=True)
    ]
    return {
        "menu": menu,
        "runs": runs,
        "minutes": design.minutes,
        "classes": [{"kinds": list(part)} for part in design.together],
        "not_shown": list(design.not_excited),
        "not_tried": dict(design.not_tried),
    }


def _signals(design: RunDesign) -> Table:
    """Return effects × chosen runs: change over the noise at the end of the plausible range."""
    head = ["change / noise", *(f"run {number}" for number in range(1, len(design.chosen) + 1))]
    rows = [
        [kind, *(f"{values[k]:.1f}" for k in design.chosen)] for kind, values in sorted(design.snr.items())
    ]
    return Table("", head, rows)
