"""A study through its stages: which blocks it has decides which stages run."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from pliant.config.mjcf_files import files_of
from pliant.config.problems import sentences
from pliant.config.study import BLOCKS, Study
from pliant.errors import MissingDependencyError, UserError
from pliant.formatting import display_unit
from pliant.interfaces.family import ActuatorFamily, FamilyConfig
from pliant.interfaces.material import require_regions
from pliant.interfaces.surrogate import Surrogate
from pliant.interfaces.task import TaskConfig
from pliant.pipeline.chain import (
    build_chain,
)
from pliant.pipeline.dataset import fem_stage
from pliant.pipeline.engine_checks import check_engines
from pliant.pipeline.loads import loads_stage
from pliant.pipeline.meta_model.designs import solved_designs, values_of
from pliant.pipeline.meta_model.stage import law_of_design, meta_model_stage
from pliant.pipeline.segments import (
    DesignSpec,
    DesignStages,
    chain_segments,
    density_of,
    distinct_designs,
    region_densities,
    segment_designs,
)
from pliant.pipeline.simulate import ChainSource, simulate_stage
from pliant.pipeline.surrogate import law_stage, without_tables
from pliant.pipeline.visual import seen_surface
from pliant.pipeline.workbench import Workbench, content, digest
from pliant.records.chain import ChainModel
from pliant.records.rollout import TaskResult
from pliant.registry.component import Component
from pliant.store.store import Artifact

DEFAULT_SURROGATE = "polynomial"
DEFAULT_PHYSICS = "quasistatic"


@dataclass(frozen=True)
class EngineRun:
    """One engine's answer to the task, or why it was skipped."""

    kind: str
    artifact: Artifact | None
    skipped: str = ""

    @property
    def result(self) -> TaskResult | None:
        """The task's result, if it ran."""
        return self.artifact.value if self.artifact else None


@dataclass(frozen=True)
class StudyRun:
    """Everything that a study's stages made."""

    study: Study
    designs: tuple[DesignStages, ...]
    chain: ChainModel | None = None
    engines: tuple[EngineRun, ...] = ()
    wall_s: float = 0.0
    unused: tuple[str, ...] = ()
    uncertainty: Artifact | None = None
    remarks: tuple[str, ...] = ()
    loads: Artifact | None = None

    @property
    def segment_designs(self) -> tuple[int, ...]:
        """For each segment of the chain, the index of its design in `designs`; empty without a chain."""
        if self.study.chain is None:
            return ()
        known = [stages.design.name for stages in self.designs]
        of_segments = segment_designs(self.study)
        return tuple(known.index(design.name) if design else 0 for design in of_segments)


def law_components(bench: Workbench, stages: Sequence[DesignStages]) -> list[Component]:
    """The surrogates and meta-models behind the laws, each once."""
    kinds = [
        ("meta_model", s.design.meta_model.kind)
        if s.design.meta_model
        else ("surrogate", s.design.surrogate.kind if s.design.surrogate else DEFAULT_SURROGATE)
        for s in stages
    ]
    return [bench.registry.get(interface, kind) for interface, kind in dict.fromkeys(kinds)]


def check_study(bench: Workbench, study: Study) -> None:
    """Build every plugin that the study names, so that a wrong design or a missing package shows at once.

    Engines of `cross_check` may be missing: they are skipped later.
    """
    for design in distinct_designs(study):
        if design.family is not None:
            built: ActuatorFamily = bench.build("family", design.family)
            if design.family.visual is not None:
                seen_surface(built)
            if study.fem is not None:
                study.fem.actuation_max(built.actuation)
            if study.material is not None:
                require_regions(built.regions, study.material.of_regions())
        if design.surrogate is not None:
            surrogate: Surrogate = bench.build("surrogate", design.surrogate)
            if design.family is not None and surrogate.needs_fem():
                surrogate.check_actuations(built.actuation)
    for key, interface in BLOCKS.items():
        if getattr(study, key) is not None:
            bench.build(interface, getattr(study, key))
    for effect in study.effects:
        bench.build("effect", effect)


def fem_of_study(bench: Workbench, study: Study) -> tuple[Artifact, ...]:
    """The FEM data of each distinct design of the study."""
    study.need("family", "FEM")
    return tuple(_fem(bench, study, family) for family in families_of_study(study))


def families_of_study(study: Study) -> tuple[FamilyConfig, ...]:
    """The family of each distinct design, in the order of `fem_of_study`."""
    return tuple({repr(d.family.canonical()): d.family for d in distinct_designs(study) if d.family}.values())


def laws_of_study(bench: Workbench, study: Study) -> tuple[DesignStages, ...]:
    """Data and law of each distinct design of the study; a design of its meta-model has no data of its own.

    Raises:
        UserError: among others, a design for which the meta-model does not hold.
    """
    designs, meta = distinct_designs(study), None
    wanted = [design.family for design in designs if design.meta_model is not None]
    if study.meta_model is not None and wanted:
        solved = solved_designs(bench, study)
        d = solved.designs
        for family in wanted:  # that it holds for them is known before it is fitted
            assert family is not None
            values_of(d.names, d.box, d.fixed, family, study.material, study.meta_model.extrapolate)
        meta = meta_model_stage(bench, study, solved)

    def stages(design: DesignSpec) -> DesignStages:
        if meta is None or design.meta_model is None or design.family is None:
            return own_law(bench, study, design)
        return DesignStages(design, None, law_of_design(bench, meta, design.family, study.material))

    return tuple(map(stages, designs))


def own_law(bench: Workbench, study: Study, design: DesignSpec) -> DesignStages:
    """Data and law of a design that takes none from a meta-model."""
    if study.meta_model is not None and design.family is None and design.surrogate is None:
        study.need("family", "a meta-model")
    surrogate = design.surrogate or _default(bench, "surrogate", DEFAULT_SURROGATE)
    fem = _fem(bench, study, design.family) if design.family and needs_fem(bench, design) else None
    return DesignStages(design, fem, law_stage(bench, surrogate, fem))


def law_of_table(
    bench: Workbench, table: Path, kind: str, settings: Mapping[str, Any] | None = None
) -> DesignStages:
    """The law that a surrogate of this kind, with these keys of its block, fits to a table of anybody's.

    Raises:
        UserError: a key that the surrogate does not have, or what is wrong with the table.
    """
    model = bench.registry.get("surrogate", kind).config_model()
    try:
        config: Any = model.model_validate({**(settings or {}), "kind": kind, "data": table})
    except ValidationError as error:
        raise UserError(sentences(error, model, lambda path: "", ("surrogate",))) from None
    return DesignStages(DesignSpec(None, config), None, law_stage(bench, config, None))


def needs_fem(bench: Workbench, design: DesignSpec) -> bool:
    """Whether the law of a design is fitted to FEM of its own."""
    surrogate = design.surrogate or _default(bench, "surrogate", DEFAULT_SURROGATE)
    wanted: bool = design.meta_model is None and bench.build("surrogate", surrogate).needs_fem()
    return wanted and design.family is not None


def chain_of_study(bench: Workbench, study: Study, mounted: bool = False) -> ChainSource:
    """The study's chain, all stages before it done; effects are not in it.

    Raises:
        UserError: among others, a chain on somebody else's arm, unless `mounted` says that the caller can have one.
    """
    chain = study.need("chain", "a simulation")
    if chain.base.mount is not None and not mounted:
        raise UserError(
            "A base that stays in the world is needed here: leave 'chain.base.mount' out. A robot on an arm can be "
            "simulated, drawn and exported (pliant run, render, export)."
        )
    check_study(bench, study)
    return _chain_source(bench, study, laws_of_study(bench, study))


def physics_of_study(bench: Workbench, study: Study) -> Any:
    """The config of the study's engine, or of the default one."""
    return study.physics or _default(bench, "physics", DEFAULT_PHYSICS)


def simulate_study(bench: Workbench, study: Study) -> StudyRun:
    """All stages up to the task in the study's engine and in those of `cross_check`."""
    started = time.perf_counter()
    study.need("chain", "a simulation")
    task = study.noisy_task()
    physics = physics_of_study(bench, study)
    check_study(bench, study)
    check_engines(bench, study, physics, *study.cross_check)
    designs = laws_of_study(bench, study)
    source = _chain_source(bench, study, designs)
    engines = [EngineRun(physics.kind, simulate_stage(bench, source, physics, task, study.effects))]
    for other in study.cross_check:
        try:
            artifact = simulate_stage(bench, source, other, task, study.effects)
            engines.append(EngineRun(other.kind, artifact))
        except MissingDependencyError as error:
            bench.progress.note(f"skipped: {error}")
            engines.append(EngineRun(other.kind, None, skipped=str(error)))
    spread = None
    if study.uncertainty is not None:
        spread = simulate_stage(bench, source, physics, task, study.effects, study.uncertainty)
    own = engines[0].result
    loads = None if own is None else loads_stage(bench, source, physics, task, study.effects, own)
    wall_s = time.perf_counter() - started
    unused, remarks = tuple(study.unused()), load_remarks(source.chain, task)
    return StudyRun(study, designs, source.chain, tuple(engines), wall_s, unused, spread, remarks, loads)


# A payload heavier than the chain by more is likely one in grams.
HEAVY = 100.0


def load_remarks(chain: ChainModel, task: TaskConfig) -> tuple[str, ...]:
    """What is odd about the payload, the task's or else the chain's: it weighs nothing, or far too much."""
    own = getattr(task, "payload_kg", None)
    payload_kg = chain.payload_kg if own is None else float(own)
    mass_kg = sum(body.mass_kg for body in chain.bodies)
    words = display_unit("kg")
    found = []
    if payload_kg > 0.0 and not np.any(chain.gravity_m_s2):
        found.append("The payload weighs nothing: chain.gravity is [0, 0, 0].")
    if payload_kg > HEAVY * mass_kg > 0.0:
        grams = words.text(payload_kg / 1000.0)
        found.append(f"A payload of {payload_kg:g} kg on a chain of {words.text(mass_kg, 2)}: is it {grams}?")
    return tuple(found)


def arm_content(study: Study) -> dict[str, Any]:
    """What keys hold of the arm that carries the chain: its meshes and included files count by their content."""
    mount = study.chain.base.mount if study.chain is not None else None
    return {} if mount is None else {"arm": [digest(file) for file in files_of(mount.file)]}


def _chain_source(bench: Workbench, study: Study, stages: Sequence[DesignStages]) -> ChainSource:
    chain = study.need("chain", "a simulation")
    # Segments as they were understood, not as they were written: "2 mm" and "0.002" make one chain. The content of
    # tables is in the keys of the laws.
    pieces = [
        without_tables({k: v for k, v in content(segment).items() if k != "family"})
        for segment in chain.as_segments()
    ]
    config: dict[str, Any] = {
        "chain": {k: v for k, v in content(chain).items() if k not in ("modules", "segments")},
        "segments": pieces,
        "families": [content(d.family) if d and d.family else None for d in segment_designs(study)],
        "surrogate": without_tables(content(study.surrogate)) if study.surrogate else {},
        "density_kg_m3": density_of(study),
    }
    config |= arm_content(study)
    if own := region_densities(study):
        config["region_densities_kg_m3"] = own
    components = [bench.component("family", study.family)] if study.family else []
    components += law_components(bench, stages)
    inputs = {f"law{number}": s.law.key for number, s in enumerate(stages)}
    built = build_chain(chain, chain_segments(bench, study, stages))
    if built.parts.max() > 1:
        # Results of before, which counted it once for each actuator, are no results of this chain.
        config["elasticity"] = "once"
    return ChainSource(built, config, inputs, components)


def _fem(bench: Workbench, study: Study, family: FamilyConfig) -> Artifact:
    return fem_stage(bench, family, study.need("material", "FEM"), study.need("fem", "FEM"))


def _default(bench: Workbench, interface: str, kind: str) -> Any:
    return bench.registry.get(interface, kind).config_model()(kind=kind)
