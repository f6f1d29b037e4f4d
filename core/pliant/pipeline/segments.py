"""Segments of a study's chain: the designs of their modules, and the pieces built from them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pliant.config.chain import ChainConfig, SegmentConfig
from pliant.config.study import Study, varied
from pliant.errors import UserError
from pliant.interfaces.base import ComponentConfig
from pliant.interfaces.family import ActuatorFamily, FamilyConfig
from pliant.interfaces.surrogate import SurrogateConfig
from pliant.pipeline.chain import (
    Module,
    RigidPiece,
    Segment,
    family_module,
    module_like,
    rigid_rod,
    rod_module,
)
from pliant.pipeline.surrogate import LawStage
from pliant.pipeline.wiring import actuators_from_configs
from pliant.pipeline.workbench import RunContext
from pliant.records.law import JointLaw
from pliant.registry.law_source import law_sources
from pliant.store.store import Artifact

# Builds a module from a law, a family, its density and those of its regions.
ModuleOf = Callable[[JointLaw, ActuatorFamily, float | None, Mapping[str, float]], Module]
OF_RODS = ("module_length_m", "module_mass_kg", "module_radius_m", "module_offset_m")


@dataclass(frozen=True)
class DesignSpec:
    """Design of modules: a family (None for a law without one) and a surrogate (None for the default).

    With a `shared` block of the study the law comes from it; the surrogate is the one that a direct FEM check fits.

    Attributes:
        family, surrogate: configs.
        shared: config of a block that gives the laws of all families, such as a meta-model.
        source: its key in the study, that of a `LawSource`.
    """

    family: FamilyConfig | None
    surrogate: SurrogateConfig | None
    shared: ComponentConfig | None = None
    source: str = ""

    @property
    def name(self) -> str:
        """Identifying text of the design, independent of the notation in the study."""
        drawn = (self.family.visual, self.family.visual_scale) if self.family else None
        configs = (self.family, self.surrogate, self.shared)
        return repr([*(c.canonical() if c else None for c in configs), drawn])


@dataclass(frozen=True)
class DesignStages:
    """One distinct design of the chain with its data and law."""

    design: DesignSpec
    fem: Artifact | None
    law: LawStage

    @property
    def family(self) -> FamilyConfig | None:
        """The family's config with the design's parameters; None without a family."""
        return self.design.family


def shared_block(study: Study) -> tuple[ComponentConfig | None, str]:
    """Return the block from which the laws of the study's families come, and its key; (None, "") without one."""
    found = ((study.block(key), key) for key in law_sources())
    return next((pair for pair in found if pair[0] is not None), (None, ""))


def segment_designs(study: Study) -> list[DesignSpec | None]:
    """Return the design of each segment's modules, with validated changes; None for a rigid piece.

    A segment that states a surrogate does not use a shared block.

    Raises:
        UserError: a segment changes a family in an invalid way.
    """
    shared = shared_block(study)
    if study.chain is None:
        return [DesignSpec(study.family, study.surrogate, *(shared if study.family else ()))]
    designs: list[DesignSpec | None] = []
    for number, segment in enumerate(study.chain.as_segments()):
        if segment.rigid is not None:
            designs.append(None)
            continue
        family: Any = study.family
        if segment.family and family is None:
            raise UserError(f"chain.segments.{number} changes a family, but the study has no 'family' block.")
        try:
            family = varied(family, segment.family) if segment.family else family
        except ValueError as error:
            raise UserError(f"chain.segments.{number}.family: {error}") from None
        own = segment.surrogate is not None or family is None
        designs.append(DesignSpec(family, segment.surrogate or study.surrogate, *(() if own else shared)))
    return designs


def distinct_designs(study: Study) -> list[DesignSpec]:
    """Return the distinct designs of the chain's modules."""
    return list({design.name: design for design in segment_designs(study) if design is not None}.values())


def chain_segments(
    context: RunContext,
    study: Study,
    stages: Sequence[DesignStages],
    module_of: ModuleOf = family_module,
) -> list[Segment]:
    """Return the segments of the study's chain, for `build_chain`.

    `module_of` builds a module, with the signature of `family_module`.
    """
    chain: ChainConfig = study.need("chain", "a simulation")
    made = {s.design.name: s for s in stages}
    families = {name: _family_module(context, study, s, module_of) for name, s in made.items()}
    configs, designs = chain.as_segments(), segment_designs(study)
    modules = [
        (families[design.name] or _rod(segment, chain, made[design.name].law.law)) if design else None
        for segment, design in zip(configs, designs, strict=True)
    ]
    segments = []
    like = next(
        module for module in modules if module is not None
    )  # gives rigid pieces their length and section
    for segment, module in zip(configs, modules, strict=True):
        like = module or like
        piece: Module | RigidPiece | None = module
        if (rigid := segment.rigid) is not None:
            length = rigid.along_m(like.length_m)
            if rigid.section == "module":
                piece = module_like(like, length, rigid.mass_kg)
            else:
                piece = rigid_rod(length, rigid.mass_kg or 0.0, rigid.radius_m)
        assert piece is not None
        own = actuators_from_configs(segment.actuators)
        segments.append(
            Segment(piece, segment.modules or 1, segment.rotation_rad, segment.actuation_share, own)
        )
    return segments


def _family_module(
    context: RunContext,
    study: Study,
    stages: DesignStages,
    module_of: ModuleOf,
) -> Module | None:
    """Return a module of the design's family, or None without one."""
    chain = study.need("chain", "a simulation")
    if stages.design.family is None:
        return None
    if any(getattr(owner, name) for owner in (chain, *chain.segments) for name in OF_RODS):
        raise UserError(
            "'module_length', 'module_mass', 'module_radius' and 'module_offset' are for chains without a "
            "'family' block; here the family gives them."
        )
    family: ActuatorFamily = context.build("family", stages.design.family)
    density = material_density(study)
    if density is None and np.any(chain.gravity_m_s2):
        raise UserError(
            "the modules' weight needs a 'material' block with a density (or set chain.gravity to [0, 0, 0])."
        )
    return module_of(stages.law.law, family, density, region_densities(study))


def _rod(segment: SegmentConfig, chain: ChainConfig, law: JointLaw) -> Module:
    length, mass, radius, offset = (_rod_dimension(segment, chain, name) for name in OF_RODS)
    return rod_module(law, length, mass, radius, offset)


def _rod_dimension(segment: SegmentConfig, chain: ChainConfig, name: str) -> Any:
    """Return a dimension of a module without a family: the segment's or else the chain's; the length is required."""
    own = getattr(segment, name)
    value = getattr(chain, name) if own is None else own
    if value is None and name == "module_length_m":
        raise UserError("a chain without a 'family' block needs 'chain.module_length', for example '11 mm'.")
    return value


def chain_length_m(context: RunContext, study: Study) -> float:
    """Return the length of the study's chain at rest, from its families or rods without any law.

    Raises:
        UserError: no chain, or a module without a length.
        InvalidDesignError: a family that cannot be built.
    """
    chain: ChainConfig = study.need("chain", "a chain's length")
    segments = chain.as_segments()
    lengths: list[float | None] = []
    for segment, design in zip(segments, segment_designs(study), strict=True):
        if design is None:
            lengths.append(None)
        elif design.family is not None:
            lengths.append(float(context.build("family", design.family).module_length_m))
        else:
            lengths.append(_rod_dimension(segment, chain, "module_length_m"))
    total, like = 0.0, next(length for length in lengths if length is not None)
    for segment, length in zip(segments, lengths, strict=True):
        like = length or like
        total += like * (segment.modules or 0) if segment.rigid is None else segment.rigid.along_m(like)
    return total


def material_density(study: Study) -> float | None:
    return float(study.material.density_kg_m3) if study.material else None


def region_densities(study: Study) -> dict[str, float]:
    """Return the density by region of the module."""
    regions = study.material.region_materials() if study.material else {}
    return {name: float(config.density_kg_m3) for name, config in regions.items()}
