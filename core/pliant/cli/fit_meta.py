"""`pliant fit STUDY.yaml` of a study with a meta-model: its scores, and the designs that should be solved next."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from pliant.cli import meta_models
from pliant.cli.session import Session, check_writable
from pliant.config.study import Study
from pliant.errors import MissingDependencyError, UserError
from pliant.pipeline.meta_model.next_design import Proposal, check_count, designs_to_solve, write_proposals
from pliant.pipeline.meta_model.stage import MetaModelStage, meta_model_stage
from pliant.pipeline.workbench import Workbench
from pliant.report.meta_stage import meta_report_stage

TABLE = "next.csv"
STUDYS_WAY = {"kind": "coefficients", "form": "study"}

Next = Annotated[
    int | None,
    typer.Option(
        "--next",
        metavar="N",
        help="Of a study with a 'meta_model': the N designs to solve next, as next.csv in --out.",
    ),
]


def fit_meta(
    here: Session,
    study: Study,
    count: int | None,
    out: Path | None,
    store: Path,
    learning: bool = True,
    compare: bool = False,
) -> None:
    """Fit the meta-model, say how it does on designs left out, and with `count` which designs it lacks most.

    With `out` its page is written, with the `learning` curve over designs.
    """
    if count is not None:
        check_count(count)
    folder = out or Path("runs") / study.name
    if count is not None or out is not None:
        check_writable(folder)
    bench = here.bench(store)
    stage = meta_model_stage(bench, study)
    here.result.update(meta_models.result(stage))
    for line in meta_models.lines(stage):
        here.say(line)
    beside = _beside(here, bench, study, stage) if compare else []
    found = designs_to_solve(bench, study, stage, count) if count is not None else []
    if found:
        _say_next(here, found, folder)
    if out is not None:
        inputs = study.canonical()
        page = meta_report_stage(
            bench, study.name, stage, inputs, out, learning=learning, proposals=found, compared=beside
        )
        here.result["report"] = page
        here.say(f"report   {page}")


def _beside(here: Session, bench: Workbench, study: Study, stage: MetaModelStage) -> list[MetaModelStage]:
    """The study's way, a network from parameters to coefficients of its form, fitted to the same designs."""
    try:
        config = (
            bench.registry.get("meta_model", STUDYS_WAY["kind"]).config_model().model_validate(STUDYS_WAY)
        )
        other = meta_model_stage(bench, study.model_copy(update={"meta_model": config}), stage.solved)
    except (UserError, MissingDependencyError) as error:
        here.say(f"beside   {STUDYS_WAY['kind']}: {error}")
        here.result["compared"] = {STUDYS_WAY["kind"]: {"problem": str(error)}}
        return []
    here.result["compared"] = {
        STUDYS_WAY["kind"]: {"scores": {place: one.as_values() for place, one in other.scores.items()}}
    }
    here.say("beside   the study's way, a network from parameters to coefficients of its form:")
    for line in meta_models.lines(other)[2:]:
        here.say(line)
    return [other]


def _say_next(here: Session, found: Sequence[Proposal], folder: Path) -> None:
    """Designs to solve next, and their table."""
    table = folder / TABLE
    write_proposals(found, table)
    here.result.update({**meta_models.proposals(found), "csv": str(table)})
    for line in meta_models.proposal_lines(found):
        here.say(line)
    here.say(f"table    {table}, for 'sweep: {{designs: {TABLE}}}'")
