"""`pliant fit STUDY.yaml` of a study with a meta-model: its scores, and the designs that should be solved next."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from pliant.cli.session import Session, check_writable
from pliant.config.study import Study
from pliant.errors import MissingDependencyError, UserError
from pliant.pipeline.learning import design_learning_stage
from pliant.pipeline.meta_model.next_design import check_count, designs_to_solve, write_proposals
from pliant.pipeline.meta_model.stage import MetaModelStage, meta_model_stage
from pliant.pipeline.workbench import Workbench
from pliant.report.meta import meta_document, stored_meta_page

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
    beside = _beside(here, bench, study, stage) if compare else []
    found = designs_to_solve(bench, study, stage, count) if count is not None else []
    curve = design_learning_stage(bench, stage) if learning and out is not None else None
    inputs: Any = study.canonical()
    more: Any = {"learning": curve, "proposals": found, "compared": beside}
    document = meta_document(study.name, stage, inputs, **more)
    here.show(document, out, stored_meta_page(bench, document, stage, inputs, **more))
    if found:
        table = folder / TABLE
        write_proposals(found, table)
        here.result["csv"] = str(table)
        here.say(f"table    {table}, for 'sweep: {{designs: {TABLE}}}'")


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
    return [other]
