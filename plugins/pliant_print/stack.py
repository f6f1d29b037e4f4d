"""The pieces of a study's chain, from its families alone: no FEM is solved and no law is needed."""

from __future__ import annotations

from typing import Any

from pliant.config.chain import ChainConfig
from pliant.config.study import Study
from pliant.errors import UserError
from pliant.interfaces.family import ActuatorFamily
from pliant.pipeline.segments import segment_designs
from pliant.pipeline.workbench import RunContext
from pliant_print.chain_solid import StackedPiece
from pliant_print.module_solid import ModuleSolid, module_solid


def study_refinement(study: Study) -> int:
    """Return the refinement of the mesh that the study solves."""
    return int(getattr(study.fem, "refinement", 1) or 1)


def study_pieces(context: RunContext, study: Study) -> list[StackedPiece]:
    """Return the chain's modules and rigid pieces as solids along its centre line.

    Raises:
        UserError: modules without a family, or a family without a mesh.
    """
    chain: ChainConfig = study.need("chain", "a solid")
    study.need("family", "a solid")
    made: dict[str, ModuleSolid] = {}
    pieces: list[StackedPiece] = []
    position, like = 0.0, None
    segments = list(zip(chain.as_segments(), segment_designs(study), strict=True))
    lengths = [_module(context, study, design, made).length_m for _, design in segments if design is not None]
    for segment, design in segments:
        if segment.rigid is not None:
            length = segment.rigid.along_m(like or lengths[0])
            piece = StackedPiece(None, 1, segment.rotation_rad, position, length, segment.rigid.radius_m)
        else:
            module = _module(context, study, design, made)
            like = module.length_m
            piece = StackedPiece(module, segment.modules or 1, segment.rotation_rad, position, like)
        last = pieces[-1] if pieces else None
        same = last is not None and last.module is piece.module and last.rotation_rad == piece.rotation_rad
        if last is not None and same and piece.module is not None:
            pieces[-1] = StackedPiece(
                last.module, last.count + piece.count, last.rotation_rad, last.start_m, last.length_m
            )
        else:
            pieces.append(piece)
        position = pieces[-1].end_m
    return pieces


def _module(context: RunContext, study: Study, design: Any, made: dict[str, ModuleSolid]) -> ModuleSolid:
    if design.family is None:
        raise UserError("a solid needs a 'family' block: rods without a family have no wall.")
    key = repr(design.family.canonical())
    if key not in made:
        family: ActuatorFamily = context.build("family", design.family)
        made[key] = module_solid(family, study_refinement(study))
    return made[key]
