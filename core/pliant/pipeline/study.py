"""A study through its stages: which blocks it has decides which stages run."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pliant.config.chain import ChainConfig, SegmentConfig
from pliant.config.study import BLOCKS, Study, varied
from pliant.errors import MissingDependencyError, UserError
from pliant.interfaces.family import ActuatorFamily, FamilyConfig
from pliant.pipeline.chain import Module, Segment, build_chain, family_module, rigid_rod, rod_module
from pliant.pipeline.dataset import fem_stage
from pliant.pipeline.simulate import ChainSource, simulate_stage
from pliant.pipeline.surrogate import LawStage, law_stage
from pliant.pipeline.workbench import Workbench, content
from pliant.records.chain import ChainModel
from pliant.records.rollout import TaskResult
from pliant.store.store import Artifact

DEFAULT_SURROGATE = "polynomial"
DEFAULT_PHYSICS = "quasistatic"


@dataclass(frozen=True)
class DesignStages:
    """One distinct design of the chain: its config (None for a law without a family), data and law."""

    family: FamilyConfig | None
    fem: Artifact | None
    law: LawStage


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

    @property
    def segment_designs(self) -> tuple[int, ...]:
        """For each segment of the chain, the index of its design in `designs`; empty without a chain."""
        if self.study.chain is None:
            return ()
        known = [design.family.canonical() if design.family else None for design in self.designs]
        families = _segment_families(self.study)
        return tuple(known.index(family.canonical() if family else None) for family in families)


def surrogate_kind(study: Study) -> str:
    """The kind of surrogate that the study names, or the default."""
    return study.surrogate.kind if study.surrogate else DEFAULT_SURROGATE


def check_study(bench: Workbench, study: Study) -> None:
    """Build every plugin that the study names, so that a wrong design or a missing package shows at once.

    Engines of `cross_check` may be missing: they are skipped later.
    """
    for family in _distinct_families(study):
        bench.build("family", family)
    for key, interface in BLOCKS.items():
        if getattr(study, key) is not None:
            bench.build(interface, getattr(study, key))
    for effect in study.effects:
        bench.build("effect", effect)


def fem_of_study(bench: Workbench, study: Study) -> tuple[Artifact, ...]:
    """The FEM data of each distinct design of the study."""
    study.need("family", "FEM")
    return tuple(_fem(bench, study, family) for family in _distinct_families(study))


def laws_of_study(bench: Workbench, study: Study) -> tuple[DesignStages, ...]:
    """Data and law of each distinct design of the study."""
    surrogate = study.surrogate or _default(bench, "surrogate", DEFAULT_SURROGATE)
    families: Sequence[FamilyConfig | None] = _distinct_families(study) or [None]
    needs_fem = bench.build("surrogate", surrogate).needs_fem()
    designs = []
    for family in families:
        fem = _fem(bench, study, family) if needs_fem and family is not None else None
        designs.append(DesignStages(family, fem, law_stage(bench, surrogate, fem)))
    return tuple(designs)


def chain_of_study(bench: Workbench, study: Study) -> ChainSource:
    """The study's chain, all stages before it done; effects are not in it."""
    study.need("chain", "a simulation")
    check_study(bench, study)
    return _chain_source(bench, study, laws_of_study(bench, study))


def physics_of_study(bench: Workbench, study: Study) -> Any:
    """The config of the study's engine, or of the default one."""
    return study.physics or _default(bench, "physics", DEFAULT_PHYSICS)


def simulate_study(bench: Workbench, study: Study) -> StudyRun:
    """All stages up to the task in the study's engine and in those of `cross_check`."""
    started = time.perf_counter()
    study.need("chain", "a simulation")
    task = study.need("task", "a simulation")
    physics = physics_of_study(bench, study)
    check_study(bench, study)
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
    wall_s = time.perf_counter() - started
    return StudyRun(study, designs, source.chain, tuple(engines), wall_s, tuple(study.unused()))


def chain_segments(bench: Workbench, study: Study, designs: Sequence[DesignStages]) -> list[Segment]:
    """The segments of the study's chain, for `build_chain`."""
    chain = study.need("chain", "a simulation")
    modules = {repr(d.family.canonical()) if d.family else "": _module(bench, study, d) for d in designs}
    segments = []
    for segment, family in zip(chain.as_segments(), _segment_families(study), strict=True):
        if segment.rigid is not None:
            rigid = segment.rigid
            segments.append(Segment(rigid_rod(rigid.length_m, rigid.mass_kg, rigid.radius_m)))
            continue
        module = _of_segment(segment, chain, modules[repr(family.canonical()) if family else ""])
        segments.append(Segment(module, segment.modules or 1, segment.rotation_rad))
    return segments


def _fem(bench: Workbench, study: Study, family: FamilyConfig) -> Artifact:
    return fem_stage(bench, family, study.need("material", "FEM"), study.need("fem", "FEM"))


def _default(bench: Workbench, interface: str, kind: str) -> Any:
    return bench.registry.get(interface, kind).config_model()(kind=kind)


def _segment_families(study: Study) -> list[FamilyConfig | None]:
    """The family config of each segment, its changes applied and validated."""
    if study.chain is None:
        return [study.family]
    result: list[FamilyConfig | None] = []
    for number, segment in enumerate(study.chain.as_segments()):
        if segment.family and study.family is None:
            raise UserError(f"chain.segments.{number} changes a family, but the study has no 'family' block.")
        try:
            changed = (
                varied(study.family, segment.family) if segment.family and study.family else study.family
            )
        except ValueError as error:
            raise UserError(f"chain.segments.{number}.family: {error}") from None
        result.append(changed)  # type: ignore[arg-type]
    return result


def _distinct_families(study: Study) -> list[FamilyConfig]:
    distinct: dict[str, FamilyConfig] = {}
    for family in _segment_families(study):
        if family is not None:
            distinct.setdefault(repr(family.canonical()), family)
    return list(distinct.values())


def _chain_source(bench: Workbench, study: Study, designs: Sequence[DesignStages]) -> ChainSource:
    chain = study.need("chain", "a simulation")
    segments = chain_segments(bench, study, designs)
    surrogate = content(study.surrogate) if study.surrogate else {"kind": DEFAULT_SURROGATE}
    surrogate.pop("data", None)  # its content is in the law's key
    # Segments as they were understood, not as they were written: "2 mm" and "0.002" make one chain.
    pieces = [{k: v for k, v in content(segment).items() if k != "family"} for segment in chain.as_segments()]
    config = {
        "chain": {k: v for k, v in content(chain).items() if k not in ("modules", "segments")},
        "segments": pieces,
        "families": [content(family) if family else None for family in _segment_families(study)],
        "surrogate": surrogate,
        "density_kg_m3": _density(study),
    }
    families = [study.family] if study.family else []
    components = [bench.component("family", family) for family in families]
    components.append(bench.registry.get("surrogate", surrogate["kind"]))
    inputs = {f"law{number}": design.law.key for number, design in enumerate(designs)}
    return ChainSource(build_chain(chain, segments), config, inputs, components)


def _of_segment(segment: SegmentConfig, chain: ChainConfig, module: Module) -> Module:
    """The segment's own rod where it has another length or mass than the chain's."""
    if segment.module_length_m is None and segment.module_mass_kg is None:
        return module
    length = segment.module_length_m or module.length_m
    mass = chain.module_mass_kg if segment.module_mass_kg is None else segment.module_mass_kg
    return rod_module(module.law, length, mass, chain.module_radius_m)


def _density(study: Study) -> float | None:
    return float(study.material.density_kg_m3) if study.material else None


def _module(bench: Workbench, study: Study, design: DesignStages) -> Module:
    chain = study.need("chain", "a simulation")
    if design.family is None:
        if chain.module_length_m is None:
            raise UserError(
                "a chain without a 'family' block needs 'chain.module_length', for example '11 mm'."
            )
        return rod_module(design.law.law, chain.module_length_m, chain.module_mass_kg, chain.module_radius_m)
    of_rods = (chain, *chain.segments)
    if chain.module_radius_m or any(c.module_length_m is not None or c.module_mass_kg for c in of_rods):
        raise UserError(
            "'module_length', 'module_mass' and 'module_radius' are for chains without a 'family' block; "
            "here the family gives them."
        )
    family: ActuatorFamily = bench.build("family", design.family)
    density = _density(study)
    if density is None and np.any(chain.gravity_m_s2):
        raise UserError(
            "the modules' weight needs a 'material' block with a density (or set chain.gravity to [0, 0, 0])."
        )
    return family_module(design.law.law, family, density)
