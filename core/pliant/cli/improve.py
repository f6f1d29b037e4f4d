"""`pliant improve`: compare → diagnose → extend, until the noise floor or an honest stop."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from pliant.cli.compare import DataFile
from pliant.cli.extend import cited, parameters_json, say_parameters
from pliant.cli.fitting_bar import fitting_bar
from pliant.cli.new_study import Force, Full, check_target
from pliant.cli.options import DEFAULT_STORE, JsonFile, Overrides, Quiet, StoreFolder, StudyFile
from pliant.cli.remarks import say_remarks
from pliant.cli.session import Session, check_writable, session
from pliant.diagnosis.extended_study import write_extended_study
from pliant.diagnosis.improvement import Improvement, Step, summary
from pliant.diagnosis.improvement import improve as improve_with
from pliant.diagnosis.next_run import next_run_json
from pliant.diagnosis.scores import score_json
from pliant.evidence.measured import measurement_of_study
from pliant.formatting import unit_of
from pliant.records.measurement import Measurement
from pliant.report.stage import write_page

NewStudy = Annotated[
    Path | None,
    typer.Option(
        "--out", metavar="NEW.yaml", help="The new study; <study>-improved.yaml beside it by default."
    ),
]
ReportFolder = Annotated[
    Path | None,
    typer.Option("--report", metavar="DIR", help="Folder of the report; runs/<name>-improve by default."),
]
Candidates = Annotated[
    list[str] | None,
    typer.Option("--effect", metavar="KIND", help="Candidate, may be repeated; all effects by default."),
]
# Outputs that stand beside each other in eighty characters.
MOST_IN_A_ROW = 3


def improve(
    study: StudyFile,
    overrides: Overrides = None,
    data: DataFile = None,
    effect: Candidates = None,
    out: NewStudy = None,
    report: ReportFolder = None,
    force: Force = False,
    full: Full = False,
    store: StoreFolder = DEFAULT_STORE,
    json: JsonFile = None,
    quiet: Quiet = False,
) -> None:
    """compare → diagnose → extend until the noise floor or an honest stop; errors are on data that was not fitted."""
    with session("improve", json, quiet) as here:
        installed = here.registry
        loaded = here.study(study, overrides)
        for kind in effect or ():
            here.registry.get("effect", kind)
        target = out or study.with_name(f"{study.stem}-improved.yaml")
        folder = report or Path("runs") / f"{loaded.name}-improve"
        check_target(study, target, force)
        bench = here.bench(store)
        measurement = measurement_of_study(bench, loaded, data)
        check_writable(folder)
        with fitting_bar(here, len(effect or here.registry.kinds("effect"))) as bar:
            found = improve_with(bench, loaded, measurement, kinds=effect, tick=bar.tick)
        here.result |= {
            "study": loaded.name,
            "data": measurement.source,
            "data_sha256": measurement.sha256,
            **improvement_json(found, measurement),
        }
        here.result["final_study"] = str(study)
        if found.final is not None:
            note = f"fitted to {cited(measurement)} by 'pliant improve', {_put_aside(found)}"
            stands_for = {kind: _stands_for(step) for step in found.steps for kind in step.added}
            write_extended_study(
                study,
                target,
                loaded,
                overrides or (),
                found.final,
                note,
                installed,
                notes_by_kind=stands_for,
                data=data,
                full=full,
            )
            here.result["final_study"] = str(target)
        _say(here, found, effect or ())
        from pliant.report.improvement import improvement_page  # matplotlib takes a second to import

        made = improvement_page(loaded.name, measurement.source, found)
        page = write_page(folder, made.html, made.pictures)
        here.result["report"] = str(page)
        here.say(f"study    {target}" if found.final is not None else "No study was written.")
        here.say(f"report   {page}")


def improvement_json(found: Improvement, measurement: Measurement) -> dict[str, Any]:
    """The keys of docs/extend_and_improve.md."""
    names = [run.name for run in measurement.runs]
    return {
        "steps": [_step_json(step) for step in found.steps],
        "stop": found.stop,
        "reason": found.reason,
        "locked_runs": [names[k] for k in found.locked.runs],
        "unseen_runs": [names[k] for k in found.locked.unseen],
        "noise_floor": {
            name: {"value": floor.value, "unit": floor.unit, "source": floor.source, "se": floor.se}
            for name, floor in found.floors.items()
        },
        "judged": found.judged,
        "parameters": {}
        if found.final is None
        else parameters_json(found.final.uncertainty, found.final.values),
        "next_experiment": next_run_json(found.next_run),
        "remarks": list(found.remarks),
    }


def _step_json(step: Step) -> dict[str, Any]:
    return {
        "added": list(step.added),
        "stands_for": list(step.stands_for),
        "why": step.why,
        "heldout": score_json(step.locked),
        "rmse_over_floor": step.locked.over_floor,
        "rmse_over_floor_se": step.locked_se,
        "unseen_rmse_over_floor": None if step.unseen is None else step.unseen.over_floor,
        "training_rmse_over_floor": step.training.over_floor,
        "effects": [effect.canonical() for effect in step.effects],
    }


def _stands_for(step: Step) -> str:
    """What the comment beside an effect says more."""
    if not step.stands_for:
        return ""
    return f"; stands for one of {', '.join(step.stands_for)}, which these data cannot tell apart"


def _put_aside(found: Improvement) -> str:
    return f"{len(found.locked.runs)} runs put aside" if found.locked.runs else "no run put aside"


def _say(here: Session, found: Improvement, asked: Sequence[str]) -> None:
    for place, step in enumerate(found.steps, start=1):
        here.say(f"{place}  {'+ ' + step.named + ': ' if step.added else ''}{step.why}")
    here.say(_table(found))
    if found.final is not None:
        say_parameters(here, found.final.uncertainty)
    say_remarks(here, found.remarks, asked)
    here.say(f"{summary(found)} {found.reason}")


def _table(found: Improvement) -> Table:
    """Errors on the runs put aside, a step a row; where more is read than fits into a row, a step a column."""
    names = list(found.steps[0].locked.rmse)
    labels = [*(unit_of(name).label for name in names), "over the noise"]
    rows = [
        [
            f"{place}  {'+ ' + step.named if step.added else 'as it was'}",
            *(unit_of(name).text(step.locked.rmse[name], 3) for name in names),
            f"{step.locked.over_floor:.2f} ± {step.locked_se:.2f}",
        ]
        for place, step in enumerate(found.steps, start=1)
    ]
    rows.append(["noise floor", *(unit_of(name).text(found.floors[name].value, 3) for name in names), "1"])
    first = f"error on {found.scored_on}"
    if len(names) <= MOST_IN_A_ROW:
        return _filled([first, *labels], rows)
    heads = [*(str(place) for place in range(1, len(rows))), "noise floor"]
    turned = zip(*(row[1:] for row in rows), strict=True)
    return _filled([first, *heads], [[label, *cells] for label, cells in zip(labels, turned, strict=True)])


def _filled(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    table = Table(box=None, pad_edge=False, header_style="bold")
    table.add_column(heads[0])
    for name in heads[1:]:
        table.add_column(name, justify="right", no_wrap=True)
    for row in rows:
        table.add_row(*row)
    return table
