"""Stage 2: data become a law τ(p, u)."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pliant.errors import PliantError, UserError
from pliant.interfaces.surrogate import Surrogate, SurrogateConfig
from pliant.pipeline.workbench import Workbench, content
from pliant.records.fem import FemDataset, ModuleData
from pliant.records.law import FitReport, JointLaw
from pliant.store.store import Artifact
from pliant.tabular.fem_columns import table_digest
from pliant.tabular.fem_reading import holds_whole_states, read_module_table, read_table

REPEATS = 5
FALLBACK = np.array([0.0, 1.0])  # a limit that a stated law does not give


@dataclass(frozen=True)
class LawStage:
    """A law, its errors (None for a stated law), the artifact that holds both (None for a stated law).

    `data` is what pictures of the law show; None where there is none of one actuation.
    """

    law: JointLaw
    report: FitReport | None
    artifact: Artifact | None
    data: FemDataset | None

    @property
    def key(self) -> str:
        """What later stages key on."""
        return self.artifact.key if self.artifact else "stated"


def law_stage(bench: Workbench, config: SurrogateConfig, dataset: Artifact | None) -> LawStage:
    """State or fit a law; `dataset` is the FEM artifact, or None where the config brings its own data."""
    surrogate: Surrogate = bench.build("surrogate", config)
    stated = surrogate.stated()
    if stated is not None:
        return LawStage(stated, None, None, None)
    tables = surrogate.tables()
    table = tables.get("")
    # States that know all axes: of the FEM stage, or of a table of several axes or actuations.
    if not tables:
        whole: ModuleData | None = dataset.value if dataset is not None else None
    else:
        whole = read_module_table(table) if table is not None and holds_whole_states(table) else None
    data, keys = _data(surrogate, dataset, whole)

    def compute(partial: Path) -> Any:
        try:
            fitted = surrogate.fit_axes(data) if whole is None else surrogate.fit_module(whole)
        except UserError as error:
            names = ", ".join(dict.fromkeys(path.name for path in tables.values()))
            raise UserError(f"{names}: {error}" if names else str(error)) from None
        return {"law": fitted.law.record(), "report": fitted.report}

    artifact = bench.make(
        "fit",
        compute,
        components=[bench.component("surrogate", config)],
        modules=["pliant.pipeline.surrogate"],
        config={"surrogate": without_tables(content(config))},
        inputs=keys,
    )
    law = surrogate.load(artifact.value["law"])
    # Pictures show the data of the law's only axis or of the main one, else the first.
    drawn = next((data[axis] for axis in ("", "y") if axis in data), next(iter(data.values()), None))
    return LawStage(law, artifact.value["report"], artifact, drawn)


def without_tables(config: Mapping[str, Any]) -> dict[str, Any]:
    """A surrogate's config without the places of its tables: their content is what counts."""
    return {
        name: without_tables(value) if isinstance(value, Mapping) else value
        for name, value in config.items()
        if name != "data"
    }


def _data(
    surrogate: Surrogate, dataset: Artifact | None, whole: ModuleData | None
) -> tuple[dict[str, FemDataset], dict[str, str]]:
    """Data sets by axis, and what keys them."""
    data, keys = {}, {}
    for axis, path in surrogate.tables().items():
        name = f"data_{axis}" if axis else "data"
        keys[name] = table_digest(path)
        if whole is None:
            data[axis] = read_table(path, axis or None)
        elif len(whole.actuations) == 1:  # no table of one axis says what several do
            data |= {one: whole.axis(one) for one in whole.explored_axes()}
    if surrogate.needs_fem():
        if dataset is None:
            raise UserError(
                f"surrogate '{surrogate.config.kind}' needs data: give a 'family', 'material' and 'fem' block, "
                "or 'surrogate.data: table.csv'."
            )
        solved: ModuleData = dataset.value
        if len(solved.actuations) > 1:  # no table of one axis says what they do: it is fitted as a whole
            return data, {**keys, "data": dataset.key}
        axes = solved.explored_axes()
        found = {axis: solved.axis(axis) for axis in axes} if len(axes) > 1 else {"": solved.axis(axes[0])}
        data = {**found, **data}  # a table of the config's own goes before FEM
        keys["data"] = dataset.key
    return data, keys


def evaluations_per_second(law: JointLaw, count: int = 20_000) -> float:
    """Best of a few calls of `law.evaluate` with `count` random states of its domain; one call warms it up."""
    box = np.vstack([law.domain.actuation, law.domain.deformation])
    box = np.where(np.isfinite(box), box, FALLBACK)
    values = box[:, 0] + np.ptp(box, axis=1) * np.random.default_rng(0).random((count, len(box)))
    m = len(law.actuations)
    p, u = np.ascontiguousarray(values[:, 0 if m == 1 else slice(m)]), np.ascontiguousarray(values[:, m:])
    law.evaluate(p, u)
    best = np.inf
    for _ in range(REPEATS):
        started = time.perf_counter()
        law.evaluate(p, u)
        best = min(best, time.perf_counter() - started)
    return count / best


def study_law_beside(bench: Workbench, data: ModuleData) -> JointLaw | None:
    """The law of the study's form, or None where it cannot be fitted or the polynomial surrogate is not installed."""
    try:
        component = bench.registry.get("surrogate", "polynomial")
        config = component.config_model().model_validate({"kind": "polynomial", "form": "study"})
        surrogate: Surrogate = component.build(config)
        return surrogate.fit_module(data).law
    except (PliantError, ValueError):
        return None
