"""A mould for casting: two halves that part across y, cores for the hollows, inserts, sprue, vents, pins.

What is cast are the modules and their cap, open at the base; the flange is glued on. Bodies of other materials than the
soft one are laid into the mould. Shrinkage scales everything about the base.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pliant.errors import UserError
from pliant.records.design import Array
from pliant.records.shape import TriangleMesh
from pliant_print.boolean import MM, box, cylinder, simplified, solid, surface, united
from pliant_print.chain_solid import ChainSolid, section_loops
from pliant_print.closing import base_flange, cast_part, inlets_at_base, outline
from pliant_print.config import MouldConfig, SolidConfig
from pliant_print.draft import drafted, undercut_share
from pliant_print.loops import Loop, deepest_point, prism, reversed_loop
from pliant_print.voids import BORE, Ends, stack_ends, void_bodies

Y = np.array([0.0, 1.0, 0.0])
VENT_M = 0.75e-3  # radius of a vent
MINE = 0.5  # share of a recovered piece that lies in the part


@dataclass(frozen=True)
class Core:
    """A core of the mould.

    Attributes:
        name: of its file.
        way: `pulled` through the base, `below` if it comes out against z where the floor is poured afterwards, or
            `lost`: undercut, to be cast of wax or printed of a soluble material and washed out.
        wider: largest width of the core over that of its opening.
    """

    name: str
    way: str
    wider: float


@dataclass(frozen=True, eq=False)
class Mould:
    """The parts of a mould as manifolds (mm), in the frame of the chain's base.

    Attributes:
        halves: on the side of +y and of −y.
        cores: by name.
        inserts: bodies that are laid in, by material.
        flange: glued to the cast part.
        part: what is cast, in its final size.
        about_cores: how each core comes out.
        recovered_m3: volume of the box less halves, cores and inserts, without sprue and vents, before shrinkage.
        differs_m3: volume in which it differs from the part, both ways.
        poured_m3: volume to pour: part, sprue and vents, before shrinkage.
        undercut: share of the halves' surface that cannot be pulled off.
        scale: of the mould over the part.
    """

    halves: tuple[Any, Any]
    cores: Mapping[str, Any]
    inserts: Mapping[str, Any]
    flange: Any
    part: Any
    about_cores: tuple[Core, ...]
    recovered_m3: float
    differs_m3: float
    poured_m3: float
    undercut: float
    scale: float

    @property
    def part_m3(self) -> float:
        """Volume of the cast part."""
        return float(self.part.volume()) * 1e-9


def mould(chain: ChainSolid, config: MouldConfig, printing: SolidConfig, cap_m: float) -> Mould:
    """Return the mould of a chain.

    Raises:
        UserError: a hollow without an opening at the base, which no core can fill.
    """
    ends = stack_ends(chain)
    scale = 1.0 / (1.0 - config.shrinkage)
    cast = cast_part(chain, ends, cap_m)
    shape, whole = outline(chain, ends, cap_m), united(cast.values())
    soft, inserts = cast[chain.soft], {k: v for k, v in cast.items() if k != chain.soft}
    cores = _with_prints(void_bodies(shape, whole), chain, ends, config, cap_m)
    low, high = _block(shape, chain, config)
    channels = united(_channels(soft, chain, cap_m, high, config))
    parts = [shape.split_by_plane((0.0, 1.0, 0.0), 0.0)[k] for k in range(2)]
    kept = np.concatenate([np.empty((0, 3)), *(surface(one).vertices_m for one in inserts.values())])
    pieces = [
        drafted(one, sign * Y, config.draft_rad, kept) for one, sign in zip(parts, (1.0, -1.0), strict=True)
    ]
    prints = united([*cores.values(), channels])
    blocks = [
        box(np.where([False, True, False], 0.0, low), high),
        box(low, np.where([False, True, False], 0.0, high)),
    ]
    halves = [block - piece - prints for block, piece in zip(blocks, pieces, strict=True)]
    halves = _pinned(halves, low, high, config)
    recovered = box(low, high) - united([*halves, *cores.values(), *inserts.values()]) - channels
    mine = united([one for one in recovered.decompose() if _inside(one, soft)])
    differs = float((mine - soft).volume() + (soft - mine).volume())
    under = max(
        undercut_share(surface(piece), sign * Y, 0.0) for piece, sign in zip(parts, (1.0, -1.0), strict=True)
    )
    grow = (scale, scale, scale)
    flange = base_flange(chain, ends, printing, inlets_at_base(ends, printing))
    return Mould(
        (simplified(halves[0]).scale(grow), simplified(halves[1]).scale(grow)),
        {name: simplified(one).scale(grow) for name, one in cores.items()},
        {name: simplified(one) for name, one in inserts.items()},
        simplified(flange),
        simplified(soft),
        tuple(_about(name, one, chain, ends) for name, one in cores.items()),
        float(mine.volume()) * 1e-9,
        differs * 1e-9,
        1e-9 * scale**3 * float(mine.volume() + (channels - shape).volume()),
        under,
        scale,
    )


def _with_prints(
    hollows: Sequence[Any], chain: ChainSolid, ends: Ends, config: MouldConfig, cap_m: float
) -> dict[str, Any]:
    """Return the cores: hollows with the ends by which they lie in the halves."""
    prints = []
    for loop in ends.base:
        if loop.is_hole:
            low = chain.start_m - config.core_print_m
            prints.append(solid(prism([reversed_loop(loop)], low, chain.start_m)))
    for loop in ends.tip:
        if loop.is_hole and ends.named(loop) == BORE:
            start = chain.end_m + cap_m
            prints.append(solid(prism([reversed_loop(loop)], start, start + config.wall_m / 2)))
    pieces = united([*hollows, *prints]).decompose()
    held = [one for one in pieces if one.bounding_box()[0] < MM * (chain.start_m - config.core_print_m / 2)]
    if len(held) < len(pieces):
        raise UserError(
            f"{len(pieces) - len(held)} hollow(s) of the chain have no opening at the base: no core can fill them, and "
            "the chain cannot be cast in one piece. Print it, or cast its modules open and glue them."
        )
    return {f"core_{number}": one for number, one in enumerate(held, 1)}


def _block(shape: Any, chain: ChainSolid, config: MouldConfig) -> tuple[Array, Array]:
    """Return two corners of the box around shape and core prints."""
    bounds = np.array(shape.bounding_box()) / MM
    low, high = bounds[:3] - config.wall_m, bounds[3:] + config.wall_m
    low[0] = chain.start_m - config.core_print_m
    return low, high


def _channels(soft: Any, chain: ChainSolid, cap_m: float, high: Array, config: MouldConfig) -> list[Any]:
    """Return sprue and vents: from the tip along the chain, or from above where a piece does not reach the tip."""
    top = chain.end_m + cap_m
    made = []
    for piece in soft.decompose():
        bounds = np.array(piece.bounding_box()) / MM
        if bounds[3] > top - 1e-6:
            made += _from_tip(piece, top, float(high[0]), config)
        else:
            middle = np.array([(bounds[0] + bounds[3]) / 2, 0.0, bounds[5] - 1e-5])
            end = np.array([middle[0], 0.0, high[2]])
            made.append(cylinder(middle, end, min(config.sprue_m / 2, (bounds[3] - bounds[0]) / 4)))
    return made


def _from_tip(piece: Any, top: float, end: float, config: MouldConfig) -> list[Any]:
    every = section_loops({"": piece}, top, 1)
    holes = [one for one in every if one.is_hole]
    loops: list[Loop] = sorted((one for one in every if not one.is_hole), key=lambda one: -one.area_m2)
    made = []
    for number, loop in enumerate(loops):
        point, reach = deepest_point(loop, holes, on_y0=True)
        radius = min(config.sprue_m / 2, 0.8 * reach) if number == 0 else min(VENT_M, 0.6 * reach)
        place = np.array([0.0, 0.0 if abs(point[0]) < reach / 4 else point[0], point[1]])
        wide = radius + (end - top) * float(np.tan(config.draft_rad)) * 2
        made.append(cylinder(place + [top - 1e-5, 0, 0], place + [end, 0, 0], radius, wide))
    return made


def _pinned(halves: list[Any], low: Array, high: Array, config: MouldConfig) -> list[Any]:
    """Return the halves with four pins on the one and holes in the other."""
    inset, radius = config.wall_m / 2, min(config.pin_m / 2, 0.4 * config.wall_m)
    first, second = halves
    length = config.pin_m
    for x in (low[0] + inset, high[0] - inset):
        for z in (low[2] + inset, high[2] - inset):
            at, tip = np.array([x, 0.0, z]), radius - length * float(np.tan(config.draft_rad))
            root = np.array([x, 1e-3, z])
            first = first + cylinder(root, at - length * Y, radius, tip)
            gap = config.clearance_m
            second = second - cylinder(at + 1e-6 * Y, at - (length + gap) * Y, radius + gap, tip + gap)
    return [first, second]


def _inside(piece: Any, part: Any) -> bool:
    """Return whether a recovered piece is part of the part, and not the gap around a pin."""
    return float((piece ^ part).volume()) > MINE * float(piece.volume())


def _about(name: str, core: Any, chain: ChainSolid, ends: Ends) -> Core:
    skin = surface(core)
    turned = TriangleMesh(skin.vertices_m, skin.faces[:, ::-1])  # of the part around it
    out = -np.eye(3)[0]
    outside = float((skin.vertices_m @ out).max())
    wider = _wider(skin, chain)
    if undercut_share(_within(turned, chain), out, outside) < 1e-3:
        return Core(name, "pulled", wider)
    down = -np.eye(3)[2]
    body = _within(turned, chain)
    floor = float((body.vertices_m[np.unique(body.faces)] @ down).max())
    if undercut_share(body, down, floor) < 1e-3:
        return Core(name, "below", wider)
    return Core(name, "lost", wider)


def _within(skin: TriangleMesh, chain: ChainSolid) -> TriangleMesh:
    """Return the faces of a core inside the part, without its prints and end faces."""
    x = skin.vertices_m[skin.faces][..., 0]
    return TriangleMesh(skin.vertices_m, skin.faces[(x.max(axis=1) > chain.start_m + 1e-9)])


def _wider(skin: TriangleMesh, chain: ChainSolid) -> float:
    x, yz = skin.vertices_m[:, 0], skin.vertices_m[:, 1:]
    opening = yz[x < chain.start_m + 1e-9]
    return float((np.ptp(yz, axis=0) / np.ptp(opening, axis=0)).max())
