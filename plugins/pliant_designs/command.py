"""What `pliant fem` does for a study with a sweep, and `pliant fit` for one with a meta-model."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from pliant import __version__
from pliant.cli.options import workers_or_scheduler
from pliant.cli.session import Session, check_writable, plain
from pliant.config.study import Study
from pliant.errors import MissingDependencyError, NotReachedError, UserError
from pliant.pipeline.workbench import RunContext
from pliant.store.store import write_atomically
from pliant_designs.fitted_model import MetaFitted
from pliant_designs.learning import design_learning_stage
from pliant_designs.next_design import check_count, designs_to_solve, write_proposals
from pliant_designs.report.meta import meta_document, stored_meta_page
from pliant_designs.report.sweep import sweep_document
from pliant_designs.stage import MetaModelStage, meta_model_stage
from pliant_designs.sweep import sweep_study
from pliant_designs.sweep_table import write_sweep_table

SWEEP_TABLE, INDEX = "fem.csv", "sweep.json"
TABLE = "next.csv"
STUDYS_WAY = {"kind": "coefficients", "form": "study"}


def report_sweep(
    session: Session,
    context: RunContext,
    study: Study,
    folder: Path,
    workers: int | None,
    scheduler: str | None,
) -> None:
    """Solve the sweep, write its table and index, and print a summary."""
    chosen = workers_or_scheduler(workers, scheduler)
    check_writable(folder)
    run = sweep_study(context, study, executor=chosen)
    write_sweep_table(run, folder / SWEEP_TABLE)
    session.show(sweep_document(run, study.name, folder / SWEEP_TABLE))
    index = {"pliant": __version__, "study": study.name, **plain(session.result)}
    write_atomically(folder / INDEX, json.dumps(index, indent=1, allow_nan=False))
    session.say(f"table    {folder / SWEEP_TABLE}, designs in {folder / INDEX}")
    if session.result["failed"] or run.failed() or not run.done():
        session.exit_code = NotReachedError.exit_code


def fit_meta_model(
    session: Session,
    study: Study,
    count: int | None,
    out: Path | None,
    learning: bool = True,
    compare: bool = False,
) -> None:
    """Fit the meta-model, print its errors on held-out designs, and with `count` propose the designs to solve next.

    With `out` its page is written, with the `learning` curve over designs.
    """
    if count is not None:
        check_count(count)
    folder = out or Path("runs") / study.name
    if count is not None or out is not None:
        check_writable(folder)
    context = session.context()
    stage = meta_model_stage(context, study)
    beside = _beside(session, context, study, stage) if compare else []
    found = designs_to_solve(context, study, stage, count) if count is not None else []
    curve = design_learning_stage(context, stage) if learning and out is not None else None
    inputs: Any = study.canonical()
    fitted = [MetaFitted(stage, curve, found), *map(MetaFitted, beside)]
    document = meta_document(study.name, fitted, inputs)
    session.show(document, out, stored_meta_page(context, document, fitted, inputs))
    if found:
        table = folder / TABLE
        write_proposals(found, table)
        session.result["csv"] = str(table)
        session.say(f"table    {table}, for 'sweep: {{designs: {TABLE}}}'")


def _beside(
    session: Session, context: RunContext, study: Study, stage: MetaModelStage
) -> list[MetaModelStage]:
    """Fit the published form, a network from parameters to the law's coefficients, to the same designs."""
    try:
        config = (
            context.registry.get("meta_model", STUDYS_WAY["kind"]).config_model().model_validate(STUDYS_WAY)
        )
        other = meta_model_stage(context, study.model_copy(update={"meta_model": config}), stage.solved)
    except (UserError, MissingDependencyError) as error:
        session.say(f"beside   {STUDYS_WAY['kind']}: {error}")
        session.result["compared"] = {STUDYS_WAY["kind"]: {"problem": str(error)}}
        return []
    session.result["compared"] = {
        STUDYS_WAY["kind"]: {"scores": {place: one.as_values() for place, one in other.scores.items()}}
    }
    return [other]
