"""Stages of a study; its blocks determine which stages run."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from pliant.config.mjcf_files import referenced_files
from pliant.config.problems import sentences
from pliant.config.study import Study
from pliant.errors import MissingDependencyError, UserError
from pliant.interfaces.family import ActuatorFamily, FamilyConfig
from pliant.interfaces.material import require_regions
from pliant.interfaces.physics import PhysicsConfig
from pliant.interfaces.surrogate import Surrogate
from pliant.pipeline.chain import build_chain
from pliant.pipeline.checks import SelfCheck
from pliant.pipeline.dataset import fem_stage
from pliant.pipeline.engine_checks import check_engines
from pliant.pipeline.equilibrium_tolerance import tolerance_remarks
from pliant.pipeline.loads import loads_stage
from pliant.pipeline.remarks import load_remarks, turned_remarks, unused_blocks, unusual_numbers
from pliant.pipeline.segments import (
    DesignSpec,
    DesignStages,
    chain_segments,
    distinct_designs,
    material_density,
    region_densities,
    segment_designs,
    shared_block,
)
from pliant.pipeline.simulate import ChainSource, simulate_stage
from pliant.pipeline.surrogate import LawStage, law_stage, stated_stage, without_tables
from pliant.pipeline.unread import unread_by_law
from pliant.pipeline.visual import seen_surface
from pliant.pipeline.workbench import RunContext, content, digest
from pliant.records.chain import ChainModel
from pliant.records.rollout import TaskResult
from pliant.registry.block import kind_blocks
from pliant.registry.component import Component
from pliant.registry.law_source import law_sources
from pliant.registry.place import imported
from pliant.store.store import Artifact

DEFAULT_SURROGATE = "polynomial"
DEFAULT_PHYSICS = "quasistatic"


@dataclass(frozen=True)
class EngineRun:
    """One engine's result of the task, or the reason for skipping it."""

    kind: str
    artifact: Artifact | None
    skipped: str = ""

    @property
    def result(self) -> TaskResult | None:
        """The task's result, if it ran."""
        return self.artifact.value if self.artifact else None


@dataclass(frozen=True)
class StudyRun:
    """Results of all stages of a study."""

    study: Study
    designs: tuple[DesignStages, ...]
    chain: ChainModel | None = None
    engines: tuple[EngineRun, ...] = ()
    wall_s: float = 0.0
    uncertainty: Artifact | None = None
    doubts: tuple[str, ...] = ()
    loads: Artifact | None = None
    checked: SelfCheck | None = None

    @property
    def unused(self) -> tuple[str, ...]:
        """The blocks that are set but that no stage of this run reads."""
        return tuple(unused_blocks(self.study, [design.fem is not None for design in self.designs]))

    @property
    def remarks(self) -> tuple[str, ...]:
        """Sentences on unusual numbers of the study and its loads, and on what the run and its checks doubt."""
        chain, task = self.chain, self.study.task
        if chain is None or task is None:
            return self.doubts
        of_chain = (*load_remarks(chain, task), *turned_remarks(self.study, chain))
        return (*of_chain, *unusual_numbers(self.study), *self.doubts)

    @property
    def segment_designs(self) -> tuple[int, ...]:
        """For each segment of the chain, the index of its design in `designs`; empty without a chain."""
        if self.study.chain is None:
            return ()
        known = [stages.design.name for stages in self.designs]
        of_segments = segment_designs(self.study)
        return tuple(known.index(design.name) if design else 0 for design in of_segments)


def law_components(context: RunContext, stages: Sequence[DesignStages]) -> list[Component]:
    """Return the distinct surrogates, and shared components, of the laws."""
    kinds = [
        (kind_blocks()[s.design.source], s.design.shared.kind)
        if s.design.shared
        else ("surrogate", s.design.surrogate.kind if s.design.surrogate else DEFAULT_SURROGATE)
        for s in stages
    ]
    return [context.registry.get(interface, kind) for interface, kind in dict.fromkeys(kinds)]


def check_study(context: RunContext, study: Study) -> None:
    """Build every plugin that the study names, so that an invalid design or a missing package is reported at once.

    Missing engines of `cross_check` are skipped later.
    """
    families = check_families(context, study)
    for design, family in zip(distinct_designs(study), families, strict=True):
        if design.surrogate is not None:
            surrogate: Surrogate = context.build("surrogate", design.surrogate)
            if family is not None and surrogate.needs_fem():
                surrogate.check_actuations(family.actuation)
    for key, interface in kind_blocks().items():
        if (block := study.block(key)) is not None:
            context.build(interface, block)
    for effect in study.effects:
        context.build("effect", effect)


def check_families(context: RunContext, study: Study) -> list[ActuatorFamily | None]:
    """Build and return the family of each distinct design, and check that the FEM block and the material fit it."""
    families: list[ActuatorFamily | None] = []
    for design in distinct_designs(study):
        if design.family is None:
            families.append(None)
            continue
        built: ActuatorFamily = context.build("family", design.family)
        if design.family.visual is not None:
            seen_surface(built)
        if study.fem is not None:
            study.fem.actuation_max(built.actuation)
        if study.material is not None:
            require_regions(built.regions, study.material.region_materials())
        families.append(built)
    return families


def solve_study_fem(context: RunContext, study: Study) -> tuple[Artifact, ...]:
    """Return the FEM data of each distinct design of the study."""
    study.need("family", "FEM")
    material, fem = study.need("material", "FEM"), study.need("fem", "FEM")
    artifacts = []
    for family in study_families(study):
        artifacts.append(fem_stage(context, family, material, fem))
    return tuple(artifacts)


def study_families(study: Study) -> tuple[FamilyConfig, ...]:
    """Return the family of each distinct design, in the order of `solve_study_fem`."""
    return tuple({repr(d.family.canonical()): d.family for d in distinct_designs(study) if d.family}.values())


def build_study_laws(context: RunContext, study: Study) -> tuple[DesignStages, ...]:
    """Return data and law of each distinct design of the study; a design with a shared block has no FEM data.

    Raises:
        UserError: among others, a design outside the range of a meta-model.
    """
    study.check_is_chain("a joint law")
    designs = distinct_designs(study)
    sharing = [design for design in designs if design.shared is not None]
    laws: Iterator[LawStage] = iter(())
    if sharing:
        source = law_sources()[sharing[0].source]
        laws = iter(imported(source.laws)(context, study, [design.family for design in sharing]))
    return tuple(
        DesignStages(design, None, next(laws))
        if design.shared is not None
        else own_law(context, study, design)
        for design in designs
    )


def own_law(context: RunContext, study: Study, design: DesignSpec) -> DesignStages:
    """Return data and law of a design whose law is its own: stated, or fitted to its FEM or to a table."""
    key = shared_block(study)[1]
    if key and design.family is None and design.surrogate is None:
        study.need("family", f"a {key.replace('_', '-')}")
    surrogate = design.surrogate or _default(context, "surrogate", DEFAULT_SURROGATE)
    stated = stated_law(context, study, design)
    fem = None
    if stated is None and design.family and needs_fem(context, study, design):
        fem = fem_stage(context, design.family, study.need("material", "FEM"), study.need("fem", "FEM"))
    elif design.family is not None and not (stated is not None and stated.stated_for_design):
        unread = unread_by_law(context.build("surrogate", surrogate), design.family, study.material)
        if unread:
            context.progress.note(unread)
    return DesignStages(design, fem, stated if stated is not None else law_stage(context, surrogate, fem))


def stated_law(context: RunContext, study: Study, design: DesignSpec) -> LawStage | None:
    """Return the law that a design's surrogate states, or its family has in closed form; None if it is fitted.

    A family's closed form is used if the study has neither a `surrogate` nor a `fem` block.
    """
    family = context.build("family", design.family) if design.family is not None else None
    material = context.build("material", study.material) if study.material is not None else None

    def default() -> Any:
        return _default(context, "surrogate", DEFAULT_SURROGATE)

    config = design.surrogate
    if config is None and study.fem is not None:
        config = default()
    return stated_stage(context, config, default, family, material)


def law_from_table(
    context: RunContext, table: Path, kind: str, settings: Mapping[str, Any] | None = None
) -> DesignStages:
    """Fit a law to any table by a surrogate of this kind with these keys of its block.

    Raises:
        UserError: a key that the surrogate does not have, or an error in the table.
    """
    model = context.registry.get("surrogate", kind).config_model()
    try:
        config: Any = model.model_validate({**(settings or {}), "kind": kind, "data": table})
    except ValidationError as error:
        raise UserError(sentences(error, model, lambda path: "", ("surrogate",))) from None
    return DesignStages(DesignSpec(None, config), None, law_stage(context, config, None))


def needs_fem(context: RunContext, study: Study, design: DesignSpec) -> bool:
    """Return whether the law of a design is fitted to FEM of that design."""
    if design.shared is not None or design.family is None:
        return False
    surrogate: Surrogate = context.build(
        "surrogate", design.surrogate or _default(context, "surrogate", DEFAULT_SURROGATE)
    )
    return surrogate.needs_fem() and stated_law(context, study, design) is None


def build_study_chain(context: RunContext, study: Study, mounted: bool = False) -> ChainSource:
    """Return the study's chain after all earlier stages, without effects.

    Raises:
        UserError: among others, a chain on an imported arm, unless the caller supports it (`mounted`).
    """
    chain = study.need("chain", "a simulation")
    if chain.base.mount is not None and not mounted:
        raise UserError(
            "A base that stays in the world is needed here: leave 'chain.base.mount' out. A robot on an arm can be "
            "simulated, drawn and exported (pliant run, render, export)."
        )
    check_study(context, study)
    return _chain_source(context, study, build_study_laws(context, study))


def study_physics(context: RunContext, study: Study) -> Any:
    """Return the config of the study's engine, or of the default one."""
    return study.physics or _default(context, "physics", DEFAULT_PHYSICS)


def simulate_study(context: RunContext, study: Study) -> StudyRun:
    """Run all stages up to the task in the study's engine and in those of `cross_check`."""
    started = time.perf_counter()
    study.need("chain", "a simulation")
    task = study.noisy_task()
    physics = study_physics(context, study)
    check_study(context, study)
    check_engines(context, study, physics, *study.cross_check)
    designs = build_study_laws(context, study)
    source = _chain_source(context, study, designs)
    engines = [EngineRun(physics.kind, simulate_stage(context, source, physics, task, study.effects))]
    for other in study.cross_check:
        try:
            artifact = simulate_stage(context, source, other, task, study.effects)
            engines.append(EngineRun(other.kind, artifact))
        except MissingDependencyError as error:
            context.progress.note(f"skipped: {error}")
            engines.append(EngineRun(other.kind, None, skipped=str(error)))
    spread = None
    if study.uncertainty is not None:
        spread = simulate_stage(context, source, physics, task, study.effects, study.uncertainty)
    own = engines[0].result
    loads = None
    if own is not None and any(task.tip_load(source.chain.payload_kg)):
        loads = loads_stage(context, source, physics, task, study.effects, own)
    wall_s = time.perf_counter() - started
    configs = [physics, *study.cross_check]
    damping = _damping_remarks(context, configs, engines)
    ran = [one for one, run in zip(configs, engines, strict=True) if run.artifact is not None]
    settled = tolerance_remarks(source.chain, [context.build("physics", one) for one in ran])
    return StudyRun(study, designs, source.chain, tuple(engines), wall_s, spread, (*damping, *settled), loads)


# Metrics of motion that depend on damping.
OF_MOTION = ("_hz", "damping_ratio", "rise_time_s", "settling_time_s", "overshoot_share")


def _damping_remarks(
    context: RunContext, configs: Sequence[PhysicsConfig], engines: Sequence[EngineRun]
) -> list[str]:
    """Return a sentence for each engine whose own damping affects the metrics of motion."""
    said = []
    for config, run in zip(configs, engines, strict=True):
        metrics = run.result.metrics if run.result is not None else {}
        names = [name for name, value in metrics.items() if name.endswith(OF_MOTION) and value is not None]
        added = context.build("physics", config).added_damping() if names else ""
        if added:
            said.append(
                f"{config.kind} adds {added} to all motion, which is no property of the body: {', '.join(names)} "
                "include it. Set it to 0 in 'physics' for the chain's own dynamics."
            )
    return said


def arm_content(study: Study) -> dict[str, Any]:
    """Return the key content of the arm that carries the chain: its meshes and included files by their content."""
    mount = study.chain.base.mount if study.chain is not None else None
    return {} if mount is None else {"arm": [digest(file) for file in referenced_files(mount.file)]}


def _chain_source(context: RunContext, study: Study, stages: Sequence[DesignStages]) -> ChainSource:
    chain = study.need("chain", "a simulation")
    # Parsed segments, not their notation: "2 mm" and "0.002" give the same chain. The content of tables is in the keys
    # of the laws.
    pieces = [
        without_tables({k: v for k, v in content(segment).items() if k != "family"})
        for segment in chain.as_segments()
    ]
    config: dict[str, Any] = {
        "chain": {k: v for k, v in content(chain).items() if k not in ("modules", "segments")},
        "segments": pieces,
        "families": [content(d.family) if d and d.family else None for d in segment_designs(study)],
        "surrogate": without_tables(content(study.surrogate)) if study.surrogate else {},
        "density_kg_m3": material_density(study),
    }
    config |= arm_content(study)
    if own := region_densities(study):
        config["region_densities_kg_m3"] = own
    components = [context.component("family", study.family)] if study.family else []
    components += law_components(context, stages)
    inputs = {f"law{number}": s.law.key for number, s in enumerate(stages)}
    built = build_chain(chain, chain_segments(context, study, stages))
    if built.parts.max() > 1:
        # Older results, which counted it once for each actuator, are not valid for this chain.
        config["elasticity"] = "once"
    return ChainSource(built, config, inputs, components)


def _default(context: RunContext, interface: str, kind: str) -> Any:
    return context.registry.get(interface, kind).config_model()(kind=kind)
