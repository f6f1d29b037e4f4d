"""The functions `pliant.open`, `pliant.read` and `pliant.fit`: where an interactive session begins."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

from pliant import api
from pliant.notebook import frames
from pliant.notebook.result import Result
from pliant.notebook.study import Fitted, Solved, StudyHandle
from pliant.pipeline.reported_law import fitted_law
from pliant.pipeline.study import law_from_table
from pliant.records.measurement import Measurement
from pliant.report.fit import table_document
from pliant.store.store import write_atomically


def open_study(path: str | Path, *, store: str | Path = api.DEFAULT_STORE, **changes: Any) -> StudyHandle:
    """Read a study file; `changes` as in `StudyHandle.with_`.

    Raises:
        UserError: the file is missing or wrong; the message lists every problem.

    >>> pliant.open(examples / "helix/helix.yaml", store=store, physics="mujoco")
    <study helix: surrogate, chain, physics, cross_check, task>
    """
    handle = StudyHandle(Path(path), (), api.open_study(path, store=store))
    return handle.with_(changes) if changes else handle


def read(files: Any, **notes: Any) -> Result[Measurement]:
    """Read measurement files, or a pandas frame, as the commands do.

    Args:
        files: a path, several, a pattern such as ``"runs/*.csv"``, or a pandas frame.
        notes: what the files do not state: ``rename={"bend": "angle_rad"}``, ``units={"p": "mbar"}``.

    Raises:
        UserError: files that cannot be read, or are ambiguous without notes.

    >>> pliant.read(examples / "hidden_effect/bench.csv").to_frame()["run"].nunique()
    14
    """
    measurement, document = api.read(files, notes)
    return Result(measurement, lambda: document, ("recording", 0), frames.readings)


def fit(
    table: Any, surrogate: str = "polynomial", *, store: str | Path = api.DEFAULT_STORE, **settings: Any
) -> Fitted:
    """Fit a joint law to a user's table, with its errors on held-out states: `pliant fit TABLE`.

    Args:
        table: a path (docs/bring_your_own_data.md), a pandas frame with the same columns, or what `solve` gave.
        surrogate: the kind of law.
        store: folder of finished stages.
        settings: keys of the surrogate's block.

    Raises:
        UserError: errors in the table, by line, or a key that the surrogate does not have.

    >>> pliant.fit(examples / "data/bellow_bending.csv", store=store).law.joint
    'revolute'
    """
    if isinstance(table, Solved):
        return table.study.with_(surrogate={"kind": surrogate, **settings}).fit()
    context = api.workbench(store)
    source = Path(table) if isinstance(table, str | Path) else _kept(table, Path(store))
    stages = law_from_table(context, source, surrogate, settings)
    config: Any = stages.design.surrogate
    fitted = fitted_law(context, surrogate, config, stages.law, learning=False, source=source.name)
    return Fitted(
        (stages,), lambda: table_document(source, stages, [fitted], {}), ("fit_law", 0), frames.laws
    )


def _kept(frame: Any, store: Path) -> Path:
    """Write a frame as CSV into the store, where the law's study finds it again, and return the path."""
    text = frame.to_csv(index=False)
    path = store / "tables" / f"{hashlib.sha256(text.encode()).hexdigest()[:16]}.csv"
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, text)
    return path.resolve()
