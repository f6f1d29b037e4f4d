"""`pliant.open(STUDY).optimize()`: a search as a result for notebooks, with a frame and a picture."""

from __future__ import annotations

import numpy as np

from pliant.api import OpenStudy
from pliant.execution.executors import Workers
from pliant.notebook.frames import Columns
from pliant.notebook.result import Result
from pliant.pipeline.study import study_physics
from pliant.report.document import Document
from pliant_search.records import STATUSES, SearchResult
from pliant_search.report.document import search_document
from pliant_search.stage import search_study


def optimize(opened: OpenStudy, executor: Workers = None, workers: int | None = None) -> Result[SearchResult]:
    """Run the study's search and check the best design: `pliant optimize`; see `search_study` for the workers."""
    context, study = opened.context, opened.study
    result: SearchResult = search_study(context, study, executor=executor, workers=workers).value
    engine = study_physics(context, study).kind

    def document() -> Document:
        return search_document(study.canonical(), result, engine=engine)

    return Result(result, document, ("search_history", 0), history_columns)


def history_columns(result: SearchResult) -> Columns:
    """Return a row per candidate in order: variables, status, objectives as stated, metrics."""
    past = result.history
    columns: Columns = {}
    for variable in result.variables:
        values = past.values[variable.name]
        chosen = variable.choices
        columns[variable.name] = (
            [chosen[int(v)] if np.isfinite(v) else None for v in values] if chosen else values
        )
    columns["status"] = [STATUSES[int(k)] for k in past.status]
    for k, (name, maximised) in enumerate(zip(result.objectives, result.maximised, strict=True)):
        columns[name] = (-1.0 if maximised else 1.0) * past.objectives[:, k]
    return {**columns, **past.metrics}
