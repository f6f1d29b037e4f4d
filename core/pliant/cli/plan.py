"""`pliant plan`: which runs to do, before anything is measured or after."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.table import Table

from pliant.cli.compare import DataFile
from pliant.cli.diagnose import Candidates
from pliant.cli.fitting_bar import fitting_bar
from pliant.cli.options import DEFAULT_STORE, JsonFile, Overrides, Quiet, StoreFolder, StudyFile
from pliant.cli.protocol_files import write_runs
from pliant.cli.session import Session, check_writable, session
from pliant.config.study import Study
from pliant.diagnosis.design import RunDesign, design_runs, unread
from pliant.diagnosis.diagnosis import Diagnosis, diagnose
from pliant.diagnosis.next_run import (
    Belief,
    NextRun,
    done_before,
    menu_of,
    next_run_json,
    next_runs,
    undecidable,
    view_of,
)
from pliant.diagnosis.words import headline, named
from pliant.errors import UserError
from pliant.evidence.measured import measurement_of_study
from pliant.evidence.prediction import Predictor
from pliant.experiments.protocols import own_runs, runs_of
from pliant.experiments.scale import BenchScale
from pliant.formatting import listed, plural
from pliant.pipeline.study import chain_of_study
from pliant.pipeline.workbench import Workbench
from pliant.records.measurement import Measurement

Runs = Annotated[
    int | None,
    typer.Option(
        "--runs", metavar="N", help="How many runs at most; 2 with data, without data as many as help."
    ),
]
Minutes = Annotated[
    float | None, typer.Option("--minutes", metavar="M", help="Bench time at most, setting up included.")
]
Folder = Annotated[
    Path | None,
    typer.Option("--out", metavar="DIR", help="Folder of the protocol files; runs/<name>-plan by default."),
]
ONE_LEFT = "One explanation is left: no further run is needed to decide."
NO_LISTED = (
    "No listed effect explains the error, so that no run can decide between them; 'pliant diagnose' tells what it "
    "depends on."
)
AFTER_DATA = 2
MOST_COLUMNS = 6


def plan(
    study: StudyFile,
    overrides: Overrides = None,
    data: DataFile = None,
    runs: Runs = None,
    minutes: Minutes = None,
    effect: Candidates = None,
    out: Folder = None,
    store: StoreFolder = DEFAULT_STORE,
    json: JsonFile = None,
    quiet: Quiet = False,
) -> None:
    """Which runs to do next: with data those that decide between the explanations left, without data a protocol."""
    with session("plan", json, quiet) as here:
        loaded = here.study(study, overrides)
        if runs is not None and runs < 1:
            raise UserError(f"--runs is {runs}; it should be 1 or more.")
        if minutes is not None and not minutes > 0:
            raise UserError(f"--minutes is {minutes:g}; it should be above 0.")
        folder = out or Path("runs") / f"{loaded.name}-plan"
        check_writable(folder)
        bench, most = here.bench(store), np.inf if minutes is None else minutes
        kinds = effect or here.registry.kinds("effect")
        for kind in kinds:
            here.registry.get("effect", kind)
        here.result |= {"study": loaded.name, "out": str(folder)}
        if data or loaded.measurements is not None:
            measurement = measurement_of_study(bench, loaded, data)
            _after(here, bench, loaded, study, measurement, data, kinds, runs or AFTER_DATA, most, folder)
        else:
            _before(here, bench, loaded, study, kinds, runs, most, folder)


def _after(
    here: Session,
    bench: Workbench,
    loaded: Study,
    study: Path,
    measurement: Measurement,
    data: Sequence[Path] | None,
    kinds: Sequence[str],
    runs: int,
    minutes: float,
    folder: Path,
) -> None:
    """Runs that decide between what a diagnosis leaves."""
    predictor = Predictor.of_study(bench, loaded, measurement)
    own = own_runs(loaded, predictor.chain, measurement)
    shortest = min(run.minutes for run in menu_of(predictor, own))
    if minutes < shortest:
        raise UserError(f"--minutes {minutes:g}: the shortest run takes {shortest:g} min with setting up.")
    with fitting_bar(here, len(kinds)) as bar:
        found = diagnose(predictor, kinds=kinds, runs=own, tick=bar.tick)
    chosen, remark = _chosen(predictor, found, own, runs, minutes)
    planned = [
        (f"run_{k}_{one.name}.csv".replace(" ", "_").replace("/", "_"), one.planned)
        for k, one in enumerate(chosen, 1)
        if one.planned is not None
    ]
    files = write_runs(folder, planned, measurement.outputs, study, loaded, measurement, data)
    here.result |= {
        "data": measurement.source,
        "data_sha256": measurement.sha256,
        "verdict": found.verdict,
        "credible_set": [list(one) for one in found.judgement.credible],
        "runs": [next_run_json(one, str(file)) for one, file in zip(chosen, files, strict=True)],
        "minutes": sum(one.minutes for one in chosen),
        "remarks": [*found.remarks, *([remark] if remark else [])],
    }
    here.say(headline(found))
    if chosen:
        here.say(_ranking(chosen[0]))
    for one, file in zip(chosen, files, strict=True):
        here.say(f"{one.name} ({one.minutes:g} min): {one.run}")
        here.say(f"  {one.why}")
        for a in dict.fromkeys(a for a, _ in one.separates):
            here.say(
                f"  expected to tell {named(a)} from {listed([named(b) for c, b in one.separates if c == a])}"
            )
        here.say(f"  file   {file}")
    if not chosen:
        here.say(remark or (NO_LISTED if found.verdict == "unknown_effect" else ONE_LEFT))


def _chosen(
    predictor: Predictor, found: Diagnosis, own: Sequence[Any], runs: int, minutes: float
) -> tuple[tuple[NextRun, ...], str]:
    """Runs one after another, and a sentence where several explanations are left and none of them helps."""
    if found.verdict == "not_repeatable" and found.next_run is not None:
        return (found.next_run,), ""
    belief = Belief.of(found.fits, found.judgement.probability, found.readings, found.noise)
    view = view_of(predictor, found.scales, found.noise.n_effective, own)
    done = done_before(view, predictor.measurement)
    chosen = next_runs(view, belief, runs, minutes, done)
    if chosen:
        return chosen, ""
    return (), undecidable(belief)


def _ranking(best: NextRun) -> Table:
    table = Table(box=None, pad_edge=False, header_style="bold")
    table.add_column("run")
    for name in ("minutes", "nats a minute", "right after it"):
        table.add_column(name, justify="right", no_wrap=True)
    for one in best.ranked[:MOST_COLUMNS]:
        table.add_row(one.name, f"{one.minutes:g}", f"{one.gain_per_minute:.3f}", f"{one.expected:.0%}")
    return table


def _before(
    here: Session,
    bench: Workbench,
    loaded: Study,
    study: Path,
    kinds: Sequence[str],
    runs: int | None,
    minutes: float,
    folder: Path,
) -> None:
    """The fewest runs that tell the effects apart."""
    chain = chain_of_study(bench, loaded).chain
    menu = runs_of(loaded.protocols, BenchScale.of_chain(chain, largest_of_task(loaded)))
    outputs = ("elongation_strain",) if chain.laws[0].joint == "prismatic" else ("angle_rad",)
    predictor = Predictor.of_study(bench, loaded, unread(menu, outputs))
    found = design_runs(predictor, menu, kinds, most_runs=runs, minutes=minutes)
    planned = [
        (f"run_{n}_{menu[k].name}.csv".replace(" ", "_").replace("/", "_"), menu[k])
        for n, k in enumerate(found.chosen, 1)
    ]
    files = write_runs(folder, planned, outputs, study, loaded)
    here.result |= design_json(found, [str(file) for file in files])
    if found.chosen:
        here.say(_signals(found))
    for number, (k, count, file) in enumerate(zip(found.chosen, found.parts[1:], files, strict=True), 1):
        run = found.runs[k]
        here.say(f"run {number}: {run.name} ({run.minutes:g} min): {run.words}")
        here.say(f"  {plural(count, 'group')} of effects told apart so far; file   {file}")
    if not found.chosen:
        here.say(
            "No run of the menu shows any of these effects; list other runs under 'protocols:' in the study."
        )
        return
    here.say(
        f"{plural(len(found.chosen), 'run')}, {found.minutes:g} min: "
        f"{plural(found.parts[-1], 'group')} of {plural(len(found.snr), 'effect')}."
    )
    for part in found.together:
        here.say(f"not told apart: {listed(list(part))}")
    if found.silent:
        here.say(f"shown by none of these runs: {listed(list(found.silent))}")


def design_json(found: RunDesign, files: Sequence[str]) -> dict[str, Any]:
    """The keys of docs/plan_the_next_experiment.md without data."""
    of_run = dict(zip(found.chosen, files, strict=True))
    return {
        "menu": [
            {
                "name": run.name,
                "run": run.words,
                "minutes": run.minutes,
                "snr": {kind: values[k] for kind, values in found.snr.items()},
            }
            for k, run in enumerate(found.runs)
        ],
        "runs": [
            {
                "name": found.runs[k].name,
                "run": found.runs[k].words,
                "minutes": found.runs[k].minutes,
                "groups": count,
                "file": of_run[k],
            }
            for k, count in zip(found.chosen, found.parts[1:], strict=True)
        ],
        "minutes": found.minutes,
        "classes": [{"kinds": list(part)} for part in found.together],
        "not_shown": list(found.silent),
        "not_tried": dict(found.not_tried),
    }


def _signals(found: RunDesign) -> Table:
    """Effects × chosen runs: change over the noise at the end of the plausible range."""
    table = Table(box=None, pad_edge=False, header_style="bold")
    table.add_column("change / noise", no_wrap=True)
    for number in range(1, len(found.chosen) + 1):
        table.add_column(f"run {number}", justify="right", no_wrap=True)
    for kind, values in sorted(found.snr.items()):
        table.add_row(kind, *(f"{values[k]:.1f}" for k in found.chosen))
    return table


def largest_of_task(loaded: Study) -> float | None:
    """The pressure or tendon force of the study's task, where it has one."""
    for name in ("pressure_pa", "tendon_force_n"):
        value = getattr(loaded.task, name, None)
        if isinstance(value, float | int):
            return float(value)
    return None
