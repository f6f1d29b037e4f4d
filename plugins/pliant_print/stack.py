"""The pieces of a study's chain, from its families alone: no FEM is solved and no law is needed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from pliant.config.chain import ActuatorConfig, ChainConfig
from pliant.config.study import Study
from pliant.errors import UserError
from pliant.interfaces.family import ActuatorFamily
from pliant.pipeline.segments import segment_designs
from pliant.pipeline.workbench import RunContext
from pliant_print.module_solid import ModuleSolid, module_solid
from pliant_print.pieces import StackedPiece


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
            inputs = cavity_inputs(module, segment.actuators or chain.actuators)
            piece = StackedPiece(
                module, segment.modules or 1, segment.rotation_rad, position, like, None, inputs
            )
        last = pieces[-1] if pieces else None
        if last is not None and piece.module is not None and _alike(last, piece):
            pieces[-1] = replace(last, count=last.count + piece.count)
        else:
            pieces.append(piece)
        position = pieces[-1].end_m
    return pieces


def cavity_inputs(module: ModuleSolid, actuators: Sequence[ActuatorConfig]) -> dict[str, str]:
    """Return the input of each cavity: of several in the order of the actuators, of one that of all of them."""
    names = [one.input for one in actuators]
    if len(names) == len(module.cavities):
        return dict(zip(module.cavities, names, strict=True))
    return {name: " ".join(names) or name for name in module.cavities}


def _alike(one: StackedPiece, other: StackedPiece) -> bool:
    return (one.module, one.rotation_rad, one.inputs) == (other.module, other.rotation_rad, other.inputs)


def _module(context: RunContext, study: Study, design: Any, made: dict[str, ModuleSolid]) -> ModuleSolid:
    if design.family is None:
        raise UserError("a solid needs a 'family' block: rods without a family have no wall.")
    key = repr(design.family.canonical())
    if key not in made:
        family: ActuatorFamily = context.build("family", design.family)
        made[key] = module_solid(family, study_refinement(study))
    return made[key]
