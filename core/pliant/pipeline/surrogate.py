"""Stage 2: fit of a law τ(p, u) to data."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pliant.errors import PliantError, PluginFailureError, UserError
from pliant.fem_tables.columns import table_digest
from pliant.fem_tables.reading import holds_whole_states, read_module_table, read_table
from pliant.interfaces.family import ActuatorFamily
from pliant.interfaces.material import Material
from pliant.interfaces.surrogate import FittedLaw, Surrogate, SurrogateConfig
from pliant.pipeline.workbench import RunContext, content
from pliant.records.fem import FemDataset, ModuleData
from pliant.records.law import FitReport, JointLaw
from pliant.store.content import content_digest
from pliant.store.store import Artifact

REPEATS = 5
FALLBACK = np.array([0.0, 1.0])  # limit that a stated law does not have


@dataclass(frozen=True)
class LawStage:
    """A law, its errors (None for a stated law), and their artifact (None for a stated law).

    `data` is shown in pictures of the law; None without data of one actuation. `stated_key` distinguishes laws that are
    stated for a geometry.
    """

    law: JointLaw
    report: FitReport | None
    artifact: Artifact | None
    data: FemDataset | None
    stated_key: str = "stated"

    @property
    def stated_for_design(self) -> bool:
        """Return whether the law is stated for the geometry of its module."""
        return self.stated_key != LawStage.stated_key

    @property
    def key(self) -> str:
        """The key that later stages depend on."""
        return self.artifact.key if self.artifact else self.stated_key


def law_stage(context: RunContext, config: SurrogateConfig, dataset: Artifact | None) -> LawStage:
    """State or fit a law; `dataset` is the FEM artifact, or None if the config names its own data."""
    component = context.component("surrogate", config)
    surrogate: Surrogate = context.build("surrogate", config)
    with component.guard("stated"):
        stated = surrogate.stated()
    if stated is not None:
        return LawStage(stated, None, None, None)
    tables = surrogate.tables()
    table = tables.get("")
    # States that cover all axes: of the FEM stage, or of a table of several axes or actuations.
    if not tables:
        whole: ModuleData | None = dataset.value if dataset is not None else None
    else:
        whole = read_module_table(table) if table is not None and holds_whole_states(table) else None
    data, keys = _data(surrogate, dataset, whole)
    given, given_whole = data, whole
    if not surrogate.gets_untrusted:
        given = {axis: one if one.trusted.all() else one.rows(one.trusted) for axis, one in data.items()}
        given_whole = whole if whole is None or whole.trusted.all() else whole.rows(whole.trusted)

    def compute(partial: Path) -> Any:
        try:
            with component.guard("fit"):
                if given_whole is None:
                    fitted = surrogate.fit_axes(given)
                else:
                    fitted = surrogate.fit_module(given_whole)
        except UserError as error:
            names = ", ".join(dict.fromkeys(path.name for path in tables.values()))
            raise UserError(f"{names}: {error}" if names else str(error)) from None
        if not isinstance(fitted, FittedLaw):
            raise PluginFailureError(
                f"{component.origin}: 'fit' returns {fitted!r}; it must return a FittedLaw."
            )
        with component.guard("record"):
            return {"law": fitted.law.record(), "report": fitted.report}

    artifact = context.make(
        "fit",
        compute,
        components=[component],
        modules=["pliant.pipeline.surrogate"],
        config={"surrogate": without_tables(content(config))},
        inputs=keys,
    )
    with component.guard("load"):
        law = surrogate.load(artifact.value["law"])
    # Pictures show the data of the law's only axis or of the main one, else the first.
    drawn = next((data[axis] for axis in ("", "y") if axis in data), next(iter(data.values()), None))
    return LawStage(law, artifact.value["report"], artifact, drawn)


def stated_stage(
    context: RunContext,
    config: SurrogateConfig | None,
    default: Callable[[], SurrogateConfig],
    family: ActuatorFamily | None,
    material: Material | None,
) -> LawStage | None:
    """Return the law that a surrogate states for a family, or its closed form; None if the law is fitted.

    Args:
        context: with the plugins.
        config: of the surrogate; None if the family's own law has priority over `default`.
        default: returns the config of the surrogate otherwise.
        family, material: of which the law may be a function.
    """
    if config is None and family is not None:
        with context.component("family", family.config).guard("closed_form"):
            law = family.closed_form(material)
        if law is not None:
            return LawStage(law, None, None, None, _digest(law))
    chosen = default() if config is None else config
    surrogate: Surrogate = context.build("surrogate", chosen)
    for_any = type(surrogate).stated_for is Surrogate.stated_for
    with context.component("surrogate", chosen).guard("stated" if for_any else "stated_for"):
        law = surrogate.stated() if for_any else surrogate.stated_for(family, material)
    if law is None:
        return None
    if for_any:
        return LawStage(law, None, None, None)
    return LawStage(law, None, None, None, _digest(law))


def _digest(law: JointLaw) -> str:
    """Return the digest of a law's record."""
    record = law.record()
    return content_digest(record.kind, record.values, record.arrays)


def without_tables(config: Mapping[str, Any]) -> dict[str, Any]:
    """Return a surrogate's config without the paths of its tables, whose content is keyed separately."""
    return {
        name: without_tables(value) if isinstance(value, Mapping) else value
        for name, value in config.items()
        if name != "data"
    }


def _data(
    surrogate: Surrogate, dataset: Artifact | None, whole: ModuleData | None
) -> tuple[dict[str, FemDataset], dict[str, str]]:
    """Return the data sets by axis, and their keys."""
    data, keys = {}, {}
    for axis, path in surrogate.tables().items():
        name = f"data_{axis}" if axis else "data"
        keys[name] = table_digest(path)
        if whole is None:
            data[axis] = read_table(path, axis or None)
        elif len(whole.actuations) == 1:  # tables of one axis do not describe several actuations
            data |= {one: whole.axis(one) for one in whole.explored_axes()}
    if surrogate.needs_fem():
        if dataset is None:
            raise UserError(
                f"surrogate '{surrogate.config.kind}' needs data: give a 'family', 'material' and 'fem' block, "
                "or 'surrogate.data: table.csv'."
            )
        solved: ModuleData = dataset.value
        if len(solved.actuations) > 1:  # tables of one axis do not describe them: fitted as a whole
            return data, {**keys, "data": dataset.key}
        axes = solved.explored_axes()
        found = {axis: solved.axis(axis) for axis in axes} if len(axes) > 1 else {"": solved.axis(axes[0])}
        data = {**found, **data}  # the config's table has priority over FEM
        keys["data"] = dataset.key
    return data, keys


def evaluations_per_second(law: JointLaw, count: int = 20_000) -> float:
    """Return the best rate of a few calls of `law.evaluate` with `count` random states, after a warm-up call."""
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


def study_law_beside(context: RunContext, data: ModuleData) -> JointLaw | None:
    """Return the law of the published form; None if it cannot be fitted or the surrogate is not installed."""
    try:
        component = context.registry.get("surrogate", "polynomial")
        config = component.config_model().model_validate({"kind": "polynomial", "form": "study"})
        surrogate: Surrogate = component.build(config)
        return surrogate.fit_module(data).law
    except (PliantError, ValueError):
        return None
