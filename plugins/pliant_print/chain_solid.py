"""The chain as solids: modules stacked and turned as in the chain model, rigid pieces between them, before closing."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pliant.records.design import Array
from pliant.records.shape import TriangleMesh
from pliant_print.boolean import MM, cylinder, library, solid, surface, united
from pliant_print.ducts import ducts, section_openings, supply
from pliant_print.loops import Loop, deepest_point, end_loops, merged, on_plane, prism, reversed_loop
from pliant_print.module_solid import BODY, LINKS, ModuleSolid
from pliant_print.pieces import StackedPiece, module_pose

MATCH = 2e-3  # of the size: ends whose lines are nearer than this continue each other
STEP_M = 1e-6  # by which a cut reaches beyond a face


@dataclass(frozen=True, eq=False)
class Band:
    """A band along a run of modules: its ends on the joint's line, its width's direction, width (m) and EA (N)."""

    start_m: Array
    end_m: Array
    across: Array
    width_m: float
    stiffness_n: float


@dataclass(frozen=True, eq=False)
class ChainSolid:
    """Bodies of a chain in the frame of its base: x along the chain from 0 to `length_m`.

    Attributes:
        bodies: manifolds (mm) by material.
        fem_volumes_m3: volume of all modules by the FEM's quadrature, by material.
        modules_m3: volume of all modules' solids, by material, before rigid pieces and connecting plates.
        start_m, end_m: of the modules along the centre line; outside are rigid pieces at the ends.
        length_m: of the centre line.
        first, first_pose: the first module of the chain; its rotation and position.
        last, last_pose: the last one.
        soft: the material of caps, flange and plates.
        notes: what was added or could not be made, in sentences.
        joined_m3: volume of rigid pieces and plates between the modules, less their ducts.
        tendons: ends of the straight lines of tendon holes.
        ribbons: bands that the FEM has by width and stiffness alone.
        supplies: channels (mm) to cavities whose input is not that of the cavity before them.
    """

    bodies: Mapping[str, Any]
    fem_volumes_m3: Mapping[str, float]
    modules_m3: Mapping[str, float]
    start_m: float
    end_m: float
    length_m: float
    first: ModuleSolid
    first_pose: tuple[Array, Array]
    last: ModuleSolid
    last_pose: tuple[Array, Array]
    notes: tuple[str, ...] = ()
    joined_m3: float = 0.0
    tendons: tuple[tuple[Array, Array], ...] = ()
    ribbons: tuple[Band, ...] = ()
    soft: str = BODY
    supplies: tuple[Any, ...] = ()


def chain_solid(pieces: Sequence[StackedPiece], supply_m: float = 2.5e-3) -> ChainSolid:
    """Return the chain of pieces; ends that do not continue each other get a plate with ducts between them.

    Cavities with different inputs are closed toward each other; the farther one gets a channel, `supply_m` wide.
    """
    runs = [_run(piece) for piece in pieces]
    bodies: dict[str, list[Any]] = {}
    fem: dict[str, float] = {}
    own: dict[str, float] = {}
    for piece, run in zip(pieces, runs, strict=True):
        for name, body in run.items():
            bodies.setdefault(name, []).append(body)
            assert piece.module is not None
            fem[name] = fem.get(name, 0.0) + piece.count * piece.module.volumes_m3[name]
            own[name] = own.get(name, 0.0) + float(body.volume()) * 1e-9
    fills, cuts, supplies, notes = _between(pieces, runs, supply_m)
    made = {name: united(parts) for name, parts in bodies.items()}
    soft = BODY if BODY in made else next(iter(made))
    before = sum(float(body.volume()) for body in made.values())
    if fills:
        plates = united(fills)
        for name in made:
            if name != soft:
                plates = plates - made[name]
        made[soft] = made[soft] + plates
    for cut in cuts:
        made = {name: body - cut for name, body in made.items()}
    added = 1e-9 * (sum(float(body.volume()) for body in made.values()) - before)
    soft_pieces = [piece for piece in pieces if piece.module is not None]
    first, last = soft_pieces[0], soft_pieces[-1]
    assert first.module is not None and last.module is not None
    every = dict.fromkeys(note for piece in pieces if piece.module for note in piece.module.notes)
    tendons = tuple(line for piece in pieces for line in _tendon(piece))
    return ChainSolid(
        made,
        fem,
        own,
        first.start_m,
        last.end_m,
        pieces[-1].end_m,
        first.module,
        module_pose(first, 0),
        last.module,
        module_pose(last, last.count - 1),
        (*every, *notes),
        added,
        tendons,
        tuple(band for piece in pieces for band in _bands(piece)),
        soft,
        tuple(supplies),
    )


def _run(piece: StackedPiece) -> dict[str, Any]:
    """Return the manifolds of equal modules in a row, welded where their ends are equal."""
    if piece.module is None:
        return {}
    made = {}
    for name, part in piece.module.bodies.items():
        copies = [part.placed(*module_pose(piece, number)) for number in range(piece.count)]
        whole = copies[0]
        for copy in copies[1:]:
            whole = whole.joined(copy)
        if name == LINKS or not _ends_equal(part, piece.module.length_m):
            made[name] = united([solid(copy, name) for copy in copies])
        else:
            made[name] = solid(merged(whole), name)
    return made


def _ends_equal(part: TriangleMesh, length_m: float) -> bool:
    """Return whether the vertices on both ends of a module are the same points of the plane."""
    near = 1e-6 * length_m
    x = part.vertices_m[:, 0]
    start, end = (part.vertices_m[np.abs(x - at) < near, 1:] for at in (-length_m / 2, length_m / 2))
    if len(start) != len(end):
        return False
    order = [one[np.lexsort(np.round(one / near).T)] for one in (start, end)]
    return bool(np.abs(order[0] - order[1]).max() < 2 * near) if len(start) else False


def section_loops(bodies: Mapping[str, Any], x_m: float, side: int) -> list[Loop]:
    """Return the loops of all bodies' faces in the plane x that face to `side` (1: toward the tip)."""
    if not bodies:
        return []
    whole = surface(united(bodies.values()))
    chosen = on_plane(whole, x_m, float(np.ptp(whole.vertices_m, axis=0).max()))
    corners = whole.vertices_m[whole.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 0]
    return end_loops(whole, chosen & (side * normal > 0))


def _between(
    pieces: Sequence[StackedPiece], runs: Sequence[Mapping[str, Any]], supply_m: float
) -> tuple[list[Any], list[Any], list[Any], list[str]]:
    """Return solids that fill rigid pieces and joints, solids to cut out for air, channels, and sentences."""
    fills: list[Any] = []
    cuts: list[Any] = []
    supplies: list[Any] = []
    notes: list[str] = []
    at = [number for number, piece in enumerate(pieces) if piece.module is not None]
    for before, after in itertools.pairwise(at):
        one, other = pieces[before], pieces[after]
        left = section_openings(one, section_loops(runs[before], one.end_m, 1))
        right = section_openings(other, section_loops(runs[after], other.start_m, -1))
        both = [name for name in one.inputs if name in left.holes and name in right.holes]
        own = [name for name in both if one.inputs[name] != other.inputs[name]]
        start, end = one.end_m, other.start_m
        touch = end - start < 1e-9
        if touch and not own and _continue(left.loops, right.loops):
            continue
        if touch:
            half = 2 * supply_m if own else 0.5 * _plate(left.loops, right.loops)
            low, high = start - half / 2, end + half / 2
            fills.append(_plate_between(left.loops, right.loops, (start - half, low), (high, end + half)))
            notes.append(_plate_note(start, high - low if own else 2 * half, bool(own)))
        else:
            radius = next((p.radius_m for p in pieces[before + 1 : after] if p.radius_m), None)
            low, high = start, end
            fills.append(
                _hull(left.loops, right.loops, start, end)
                if radius is None
                else cylinder([start, 0, 0], [end, 0, 0], radius)
            )
            notes.append(
                f"The rigid piece from {1e3 * start:.4g} to {1e3 * end:.4g} mm is a solid block of the body's "
                f"material{'' if own else ' with a duct for the air'}."
            )
        reach = 0.1 * (high - low) if touch else STEP_M
        cuts += ducts(left, right, low - reach, high + reach, own)
        supplies += [supply(right, name, low, high + reach, supply_m) for name in own]
        if own:
            names = ", ".join(other.inputs[name] for name in own)
            notes.append(
                f"{names}: closed toward the modules before {1e3 * other.start_m:.4g} mm; each has a channel from "
                f"{'the bore' if right.bores else 'the outside'}, for a tube."
            )
    return fills, cuts, supplies, notes


def _plate_note(at_m: float, thick_m: float, closes: bool) -> str:
    why = "inputs differ" if closes else "sections do not continue each other"
    what = "closes the cavities" if closes else "with a duct joins them"
    return (
        f"At {1e3 * at_m:.4g} mm the {why}; a plate of {1e3 * thick_m:.3g} mm {what}, which the chain model does "
        "not have."
    )


def _plate_between(
    left: Sequence[Loop], right: Sequence[Loop], before: tuple[float, float], after: tuple[float, float]
) -> Any:
    """Return a plate that reaches into both ends, with their openings up to its middle part."""
    plate = _hull(left, right, before[0], after[1])
    for loops, (a, b) in (
        (left, (before[0] - STEP_M, before[1])),
        (right, (after[0], after[1] + STEP_M)),
    ):
        for one in loops:
            if one.is_hole:
                plate = plate - solid(prism([reversed_loop(one)], a, b))
    return plate


def _plate(left: Sequence[Loop], right: Sequence[Loop]) -> float:
    """Return the thickness of a connecting plate: three radii of its duct, at most."""
    radii = [deepest_point(reversed_loop(one))[1] for one in (*left, *right) if one.is_hole]
    return 1.5 * min([*radii, 2e-3])


def _continue(left: Sequence[Loop], right: Sequence[Loop]) -> bool:
    """Return whether two ends have the same lines."""
    if len(left) != len(right) or not left:
        return False
    size = max(float(np.ptp(one.points_m, axis=0).max()) for one in left)
    ends = [np.concatenate([one.points_m for one in loops]) for loops in (left, right)]
    return all(_reach(a, loops) < MATCH * size for a, loops in ((ends[0], right), (ends[1], left)))


def _reach(points: Array, loops: Sequence[Loop]) -> float:
    """Return the largest distance of points from the loops' lines."""
    start = np.concatenate([one.points_m for one in loops])
    end = np.concatenate([np.roll(one.points_m, -1, axis=0) for one in loops])
    along = end - start
    share = np.einsum("gkj,kj->gk", points[:, None] - start, along) / (along**2).sum(axis=1)
    nearest = start + np.clip(share, 0, 1)[..., None] * along
    return float(np.linalg.norm(points[:, None] - nearest, axis=2).min(axis=1).max())


def _hull(left: Sequence[Loop], right: Sequence[Loop], start: float, end: float) -> Any:
    """Return the convex hull of two ends' outlines, extruded."""
    points = np.concatenate([one.points_m for one in (*left, *right) if not one.is_hole])
    corners = np.concatenate([np.column_stack([np.full(len(points), x), points]) for x in (start, end)])
    return library().Manifold.hull_points(MM * corners)


def _line(piece: StackedPiece, y_m: float, z_m: float) -> tuple[Array, Array]:
    """Return the two ends of a straight line through a run of modules, from (y, z) in their frame."""
    half = np.array([0.5 * piece.length_m, 0.0, 0.0])
    there = np.array([0.0, y_m, z_m])
    (turn, first), (_, last) = module_pose(piece, 0), module_pose(piece, piece.count - 1)
    return first + turn @ (there - half), last + turn @ (there + half)


def _tendon(piece: StackedPiece) -> list[tuple[Array, Array]]:
    if piece.module is None or piece.module.tendon is None:
        return []
    return [_line(piece, *piece.module.tendon)]


def _bands(piece: StackedPiece) -> list[Band]:
    if piece.module is None:
        return []
    across = module_pose(piece, 0)[0] @ np.array([0.0, 1.0, 0.0])
    return [
        Band(*_line(piece, 0.0, 0.0), across, width, stiffness)
        for width, stiffness in piece.module.ribbons.values()
    ]
