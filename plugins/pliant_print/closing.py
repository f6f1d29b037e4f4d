"""A chain closed for printing: cap, flange with inlets, tendon holes, bands; and closed for casting: cap alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pliant.records.design import Array
from pliant.records.shape import TriangleMesh
from pliant_print.boolean import MM, cylinder, library, placed, simplified, solid, united
from pliant_print.chain_solid import Band, ChainSolid
from pliant_print.config import SolidConfig
from pliant_print.loops import deepest_point, filled, merged, prism, reversed_loop
from pliant_print.module_solid import LINKS
from pliant_print.voids import BORE, Ends, stack_ends

STEP_M = 1e-6  # by which a cut reaches beyond a face
LEAST_WALL_M = 0.5e-3  # between neighbouring sockets
RIBBON = "ribbon"


@dataclass(frozen=True, eq=False)
class Inlet:
    """A channel from the flange's face to a void: its name, place (y, z) and radius."""

    name: str
    point_m: Array
    radius_m: float


@dataclass(frozen=True, eq=False)
class ClosedChain:
    """A pressure-tight chain as bodies to print.

    Attributes:
        bodies: manifolds (mm) by material.
        chain: the stack that it closes.
        ends: its ends before closing.
        inlets: of the flange.
        cap_m, flange_m: thicknesses; the flange begins at x = −flange.
        removed_m3: volume between the ends that bands, tendon holes and channels take, which the FEM does not know.
        notes: sentences.
    """

    bodies: Mapping[str, Any]
    chain: ChainSolid
    ends: Ends
    inlets: tuple[Inlet, ...]
    cap_m: float
    flange_m: float
    removed_m3: float
    notes: tuple[str, ...]


def closed_chain(chain: ChainSolid, config: SolidConfig, wall_m: float) -> ClosedChain:
    """Return the chain with cap, flange, inlets, tendon holes and bands; `wall_m` is its thinnest wall."""
    ends = stack_ends(chain)
    bodies = dict(chain.bodies)
    host = LINKS if LINKS in bodies else chain.soft
    cap_m = tip_cap_m(chain, config, wall_m)
    inlets = inlets_at_base(ends, config)
    added = [base_flange(chain, ends, config, inlets)]
    if chain.start_m > 0:
        added.append(solid(prism(ends.base, 0.0, chain.start_m), "the rigid piece at the base"))
    if cap_m:
        added.append(tip_cap(chain, ends, cap_m))
    bodies[host] = united([bodies[host], *added])
    notes, removed = list(chain.notes), 0.0
    for start, end in chain.tendons:
        reach = np.array([config.flange_m + 2 * STEP_M, 0.0, 0.0])
        hole = cylinder(start - reach, end + reach + [cap_m, 0.0, 0.0], config.tendon_bore_m / 2)
        within = _between(bodies[host], chain.start_m, chain.end_m)
        removed += 1e-9 * float((within ^ hole).volume())
        bodies[host] = bodies[host] - hole
    for channel in chain.supplies:
        within = _between(bodies[host], chain.start_m, chain.end_m)
        removed += 1e-9 * float((within ^ channel).volume())
        bodies[host] = bodies[host] - channel
    if chain.tendons:
        notes.append(f"The tendon runs in a hole of {1e3 * config.tendon_bore_m:.3g} mm through every link.")
    band = _bands(chain, config, cap_m, ends, inlets)
    if band is not None:
        inside = {name: body ^ band for name, body in bodies.items()}
        trimmed = [_between(body, chain.start_m, chain.end_m) for body in inside.values()]
        removed += 1e-9 * sum(float(body.volume()) for body in trimmed)
        bodies = {name: body - band for name, body in bodies.items()}
        bodies[RIBBON] = band
        notes += [_band_note(one, config) for one in chain.ribbons[:1]]
    closed = [name for name in ends.voids.values() if name not in {one.name for one in inlets}]
    if chain.first.cavities and not inlets:
        notes.append("The cavity has no opening at the base, so that the flange has no inlet; drill one.")
    elif closed:
        notes.append(f"No inlet reaches {', '.join(dict.fromkeys(closed))}: it has no opening at the base.")
    bodies = {name: simplified(body) for name, body in bodies.items()}
    return ClosedChain(bodies, chain, ends, inlets, cap_m, config.flange_m, removed, tuple(notes))


def tip_cap_m(chain: ChainSolid, config: SolidConfig, wall_m: float) -> float:
    """Return the thickness of the cap: a rigid piece's at the tip, the study's, or twice the wall; 0 without cavity."""
    if chain.length_m > chain.end_m + STEP_M:
        return chain.length_m - chain.end_m
    if not chain.first.cavities:
        return 0.0
    return config.cap_m or 2 * wall_m


def tip_cap(chain: ChainSolid, ends: Ends, cap_m: float) -> Any:
    """Return the plate that closes all cavities at the tip and leaves a bore open."""
    loops = ends.kept(ends.tip, (BORE,))
    return solid(prism(loops, chain.end_m, chain.end_m + cap_m), "the cap")


def inlets_at_base(ends: Ends, config: SolidConfig) -> tuple[Inlet, ...]:
    """Return an inlet for each opening of a cavity at the base, at its deepest point."""
    found = []
    for loop in ends.base:
        if loop.is_hole and ends.named(loop) != BORE:
            point, reach = deepest_point(reversed_loop(loop))
            found.append(Inlet(ends.named(loop), point, min(config.inlet_bore_m / 2, 0.8 * reach)))
    return tuple(found)


def base_flange(
    chain: ChainSolid, ends: Ends, config: SolidConfig, inlets: Sequence[Inlet], x_m: float = 0.0
) -> Any:
    """Return the round plate at the base with screw holes, inlets with sockets for tubes, and open bores."""
    points = np.concatenate([one.points_m for one in ends.base if not one.is_hole])
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    section = float(np.linalg.norm(points - centre, axis=1).max())
    thick = config.flange_m
    start, end = np.array([x_m - thick, *centre]), np.array([x_m, *centre])
    plate = cylinder(start, end, section + config.flange_margin_m)
    cuts = [
        solid(prism([reversed_loop(one)], x_m - thick - STEP_M, x_m + STEP_M))
        for one in ends.base
        if one.is_hole and ends.named(one) == BORE
    ]
    for inlet in inlets:
        at = np.array([0.0, *inlet.point_m])
        low, high = x_m - thick - STEP_M, x_m + STEP_M
        cuts.append(cylinder(at + [low, 0, 0], at + [high, 0, 0], inlet.radius_m))
        socket = socket_radius_m(inlet, inlets, config)
        if socket > inlet.radius_m:
            cuts.append(cylinder(at + [low, 0, 0], at + [x_m - thick / 3, 0, 0], socket))
    around = section + config.flange_margin_m / 2
    if config.screws and config.flange_margin_m > config.screw_m:
        for k in range(config.screws):
            angle = 2 * np.pi * (k + 0.5) / config.screws
            at = np.array([0.0, *(centre + around * np.array([np.cos(angle), np.sin(angle)]))])
            cuts.append(
                cylinder(at + [x_m - thick - STEP_M, 0, 0], at + [x_m + STEP_M, 0, 0], config.screw_m / 2)
            )
    return plate - united(cuts) if cuts else plate


def socket_radius_m(inlet: Inlet, inlets: Sequence[Inlet], config: SolidConfig) -> float:
    """Return the radius of a tube's socket, less where the next inlet is near."""
    apart = [float(np.linalg.norm(inlet.point_m - other.point_m)) for other in inlets if other is not inlet]
    return min([config.tube_m / 2, *((gap - LEAST_WALL_M) / 2 for gap in apart)])


def _between(body: Any, low_m: float, high_m: float) -> Any:
    """Return the part of a manifold between two planes across x."""
    return body.trim_by_plane((1.0, 0.0, 0.0), MM * low_m).trim_by_plane((-1.0, 0.0, 0.0), -MM * high_m)


def modules_volume_m3(closed: ClosedChain) -> float:
    """Return the volume of the modules, measured on the closed solid between its end sections.

    Rigid pieces and plates between modules are subtracted, what bands and tendon holes take is added.
    """
    chain = closed.chain
    bodies = [body for name, body in closed.bodies.items() if name != RIBBON]
    within = sum(float(_between(body, chain.start_m, chain.end_m).volume()) for body in bodies)
    return 1e-9 * within - chain.joined_m3 + closed.removed_m3


def _bands(
    chain: ChainSolid, config: SolidConfig, cap_m: float, ends: Ends, inlets: Sequence[Inlet]
) -> Any | None:
    """Return the bands as one solid, anchored in flange and cap; None without bands."""
    if not chain.ribbons:
        return None
    made = []
    for number, band in enumerate(chain.ribbons):
        start, end = band.start_m.copy(), band.end_m.copy()
        start[0] -= config.flange_m / 3 if number == 0 else 0.0
        end[0] += cap_m / 2 if number == len(chain.ribbons) - 1 else 0.0
        made.append(_strip(start, end, band, config.ribbon_m))
    strip = united(made)
    for inlet in inlets:
        at = np.array([0.0, *inlet.point_m])
        strip = strip - cylinder(at - [config.flange_m, 0, 0], at + [STEP_M, 0, 0], inlet.radius_m)
    return strip


def _strip(start: Array, end: Array, band: Band, thick_m: float) -> Any:
    length = float(np.linalg.norm(end - start))
    along = (end - start) / length
    size = (MM * length, MM * band.width_m, MM * thick_m)
    rotation = np.column_stack([along, band.across, np.cross(along, band.across)])
    cube = library().Manifold.cube(size).translate((0.0, -size[1] / 2, -size[2] / 2))
    return placed(cube, rotation, start)


def _band_note(band: Band, config: SolidConfig) -> str:
    modulus = band.stiffness_n / (band.width_m * config.ribbon_m)
    return (
        f"The FEM has a band of {1e3 * band.width_m:.3g} mm by its stiffness EA = {band.stiffness_n:.3g} N alone; here "
        f"it is a body of its own, {1e3 * config.ribbon_m:.3g} mm thick, whose material needs "
        f"E = {modulus / 1e6:.3g} MPa."
    )


def outline(chain: ChainSolid, ends: Ends, cap_m: float) -> Any:
    """Return the filled outside of the modules and the cap: no voids and no bore."""
    faces = [ends.whole.faces[ends.outer]]
    vertices = [ends.whole.vertices_m]
    first = len(ends.whole.vertices_m)
    for loops, x, turned in ((ends.base, chain.start_m, True), (ends.tip, chain.end_m, False)):
        points, flat = filled([one for one in loops if not one.is_hole])
        vertices.append(np.column_stack([np.full(len(points), x), points]))
        faces.append((flat[:, ::-1] if turned else flat) + first)
        first += len(points)
    shell = solid(
        merged(TriangleMesh(np.concatenate(vertices), np.concatenate(faces))), "the outside of the chain"
    )
    if not cap_m:
        return shell
    loops = [one for one in ends.tip if not one.is_hole]
    return shell + solid(prism(loops, chain.end_m, chain.end_m + cap_m), "the cap")


def cast_part(chain: ChainSolid, ends: Ends, cap_m: float) -> dict[str, Any]:
    """Return the bodies that are cast or laid into the mould: the modules and their cap, open at the base."""
    bodies = dict(chain.bodies)
    if cap_m:
        bodies[chain.soft] = bodies[chain.soft] + tip_cap(chain, ends, cap_m)
    return bodies
