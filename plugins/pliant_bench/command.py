"""`pliant experiment`: plan, run, record and diagnose until a cause is named or no run gives further information."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Annotated

import typer

from pliant import api
from pliant.cli.options import (
    Fitters,
    Overrides,
    Scheduler,
    StudyFile,
    report_folder,
    verb,
    workers_or_scheduler,
)
from pliant.cli.session import Session, check_writable
from pliant.errors import UserError
from pliant.formatting import listed, plural
from pliant_bench.bench import Bench, ChannelCheck
from pliant_bench.config import ExperimentConfig
from pliant_bench.loop.assumptions import assumptions
from pliant_bench.loop.decision import Ended
from pliant_bench.loop.dry_run import dry_run_document
from pliant_bench.loop.experiment import Experiment
from pliant_bench.loop.fit_progress import IMPROVING
from pliant_bench.loop.folder import ExperimentFolder
from pliant_bench.loop.improving import IMPROVABLE, improve_study
from pliant_bench.loop.person import Nobody, Person, words
from pliant_bench.loop.planner import TellingPlanner, model_inputs
from pliant_bench.loop.report import experiment_document
from pliant_bench.loop.rounds import run_minutes, run_rounds
from pliant_bench.loop.terminal import TerminalPerson, TerminalView

Yes = Annotated[
    bool, typer.Option("--yes", help="Begin without a question; on hardware only with `unattended: true`.")
]
DryRun = Annotated[
    bool,
    typer.Option("--dry-run", help="Print and draw the next run and its expected motion; nothing moves."),
]
Candidates = Annotated[
    list[str] | None,
    typer.Option("--effect", metavar="KIND", help="Candidate, may be repeated; all effects by default."),
]


@verb()
def experiment(
    session: Session,
    study: StudyFile,
    overrides: Overrides = None,
    effect: Candidates = None,
    out: Annotated[Path | None, report_folder("experiment")] = None,
    dry_run: DryRun = False,
    yes: Yes = False,
    workers: Fitters = None,
    scheduler: Scheduler = None,
) -> None:
    """Plan, run, record and diagnose on a bench until a cause is named; resumes where it was interrupted."""
    loaded = session.study(study, overrides, uses=("protocols",))
    loaded.need("experiment", "'pliant experiment'")
    loaded.need("bench", "'pliant experiment'")
    session.leave_out_broken_effects()
    settings: ExperimentConfig = getattr(loaded, "experiment")  # noqa: B009 - a package's block
    opened = api.OpenStudy(loaded, session.context())
    kinds = api.candidates(opened, effect)
    folder = ExperimentFolder(out or Path("runs") / f"{loaded.name}-experiment")
    check_writable(folder.path)
    bench: Bench = opened.context.build("bench", getattr(loaded, "bench"))  # noqa: B009
    person = _person(session, bench, settings, yes)
    who = loaded.resolve_workers(workers_or_scheduler(workers, scheduler), 1)
    session.result |= {"study": loaded.name, "out": str(folder.path)}
    bench.study_limits = settings.input_limits
    try:
        bench.connect()
        planner = TellingPlanner(opened, _asked(settings, bench, person), bench)
        inputs = model_inputs(opened)
        assumed = assumptions(opened, settings.standing)
        session.result["assumed"] = assumed
        if dry_run:
            dry = folder.path / "dry-run"
            check_writable(dry)
            session.show(dry_run_document(opened, folder, planner, inputs, kinds, assumed, who), dry)
            return
        for sentence in assumed:
            session.say(f"  {sentence}")
        resumed = folder.begin(
            {"study": loaded.name, "study_sha256": _digest(study), "bench": bench.config.kind}
        )
        if resumed:
            session.say(f"{folder.path}: resumed after {plural(len(folder.rounds()), 'run')}.")
        _check_channels(session, bench.check())
        _confirm(person, bench, settings, bool(folder.recordings()))
        view = TerminalView(session)
        going = Experiment(
            opened, settings, bench, folder, inputs, kinds, planner, person or Nobody(), view, who
        )
        ended = run_rounds(going)
    except KeyboardInterrupt:
        session.say("The bench was vented. The same command goes on after the last recording.")
        raise
    finally:
        bench.close()
    _report(session, going, study, ended)


def _person(session: Session, bench: Bench, settings: ExperimentConfig, yes: bool) -> Person | None:
    """Return who is asked; None for nobody."""
    if not bench.is_hardware:
        return None
    if yes and not settings.unattended:
        raise UserError(
            "--yes is for benches without a person: the study's block 'experiment' needs 'unattended: true' for it."
        )
    return None if yes else TerminalPerson(session)


def _asked(settings: ExperimentConfig, bench: Bench, person: Person | None) -> ExperimentConfig:
    """Return the settings without what only a person can set, for hardware without an operator."""
    if person is not None or not bench.is_hardware:
        return settings
    standing = {name: levels[:1] for name, levels in settings.manual.items()}
    return settings.model_copy(update={"manual": standing})


def _check_channels(session: Session, checks: tuple[ChannelCheck, ...]) -> None:
    for one in checks:
        session.say(f"  {words(one.name, one.value)}{f': {one.problem}' if one.problem else ''}")
    if wrong := [one for one in checks if one.problem]:
        raise UserError(f"channel '{wrong[0].name}' failed its check: {wrong[0].problem}")


def _confirm(person: Person | None, bench: Bench, settings: ExperimentConfig, begun: bool) -> None:
    """Ask before the first run on hardware."""
    if person is None or begun:
        return
    tops = [words(name, one.limits(name).high) for name, one in settings.inputs.items()]
    limits = f"at most {listed(tops)}"
    if not person.confirm(f"The bench will move ({limits})."):
        raise UserError("The experiment was not begun; --dry-run shows its first run.")


def _digest(study: Path) -> str:
    return hashlib.sha256(study.read_bytes()).hexdigest()


def _report(session: Session, going: Experiment, study: Path, ended: Ended) -> None:
    """Write the improved study where something is to be added, and the report."""
    folder, opened = going.folder, going.opened
    minutes = sum(run_minutes(one) for one in folder.rounds())
    verdicts = [one for f in folder.rounds() if (one := f.read("verdict")) is not None]
    improved = None
    if verdicts and verdicts[-1]["verdict"] in IMPROVABLE:
        last = verdicts[-1]
        steps = 1 + bool(last["selected"] or last["selected_class"])
        session.say("  The model is improved with all recordings.")
        tick = going.progress(IMPROVING, last, steps).tick
        improved = improve_study(session, opened, study, folder, last, going.kinds, tick, going.workers)
        going.view.improved()
    folder.write_status(doing="ended", why=ended.why, sentence=ended.sentence)
    session.show(experiment_document(opened.study.name, folder, ended, minutes, improved), folder.path)
