"""A slender rod in PyElastica (Gazzola et al. 2018) that swings in a plane: let go from a bend, or bent by a step.

It has as many bends as a chain has joints, at the same places, so that what sets the two apart is how they are solved.
Shear and stretch are suppressed by stiffness, its sections' inertia by their size.
"""

from __future__ import annotations

import logging
import math
from typing import Any, NamedTuple

import elastica
import numpy as np
from benchmarks.physics.cosserat import COURANT, Rods, weigh

from pliant.records.design import Array

# Against stretch and shear, N; the radius by which sections have inertia, in cells; the step over that of a wave
# through a cell: half cells, and sections that spin against shear and bend.
AXIAL_N, RADIUS_CELLS, SHORTER = 200.0, 0.5, 0.25


class SlenderRod(NamedTuple):
    """Length (m), flexural stiffness (N·m²), mass per length (kg/m), bends."""

    length_m: float
    flexural_n_m2: float
    line_kg_m: float
    bends: int


class Swing(NamedTuple):
    """Times (t,) in s, the turn of the tip (t,) in rad, steps in all."""

    time_s: Array
    angle: Array
    steps: int


def swing(
    rod: SlenderRod,
    before_1_m: float,
    after_1_m: float,
    duration_s: float,
    record_s: float,
    drag_1_s: float = 0.0,
) -> Swing:
    """Simulate from rest at the natural curvature `before_1_m`, which is `after_1_m` from then on.

    `drag_1_s` takes exp(−drag · time) of every velocity.
    """
    made = _rod(rod)
    cell = rod.length_m / rod.bends
    step = COURANT * SHORTER * cell * math.sqrt(rod.line_kg_m / AXIAL_N)
    every = math.ceil(record_s / step)
    step = record_s / every
    _bend(made, before_1_m, rod)
    made.rest_kappa[0] = after_1_m * cell / made.rest_voronoi_lengths
    system: Any = Rods()
    system.append(made)
    system.constrain(made).using(
        elastica.OneEndFixedBC, constrained_position_idx=(0,), constrained_director_idx=(0,)
    )
    if drag_1_s:
        damping = {"uniform_damping_constant": drag_1_s, "time_step": step}
        system.dampen(made).using(elastica.AnalyticalLinearDamper, **damping)
    system.finalize()
    stepper, now = elastica.PositionVerlet(), np.float64(0.0)
    angles = [_turn(made)]
    for _ in range(round(duration_s / record_s)):
        for _ in range(every):
            now = stepper.step(system, now, np.float64(step))
        angles.append(_turn(made))
    return Swing(record_s * np.arange(len(angles)), np.array(angles), every * (len(angles) - 1))


def _rod(rod: SlenderRod) -> Any:
    """Build a straight rod along x; elements of half a cell, whole cells, half a cell."""
    cell = rod.length_m / rod.bends
    elements = np.array([cell / 2, *[cell] * (rod.bends - 1), cell / 2])
    nodes, along = np.concatenate([[0.0], np.cumsum(elements)]), np.array([1.0, 0.0, 0.0])
    radius = RADIUS_CELLS * cell
    logging.disable(logging.WARNING)  # of inertias that it finds suspiciously small
    made = elastica.CosseratRod.straight_rod(
        len(elements),
        np.zeros(3),
        along,
        np.array([0.0, 1.0, 0.0]),
        rod.length_m,
        radius,
        1.0,
        youngs_modulus=1.0,
        shear_modulus=1.0,
        position=np.outer(along, nodes),
    )
    logging.disable(logging.NOTSET)
    weigh(made, elements, nodes, np.full(rod.bends, cell), np.full(rod.bends, rod.line_kg_m), radius)
    for k in range(len(elements)):
        made.shear_matrix[..., k] = AXIAL_N * np.eye(3)
    for k in range(rod.bends):
        share = made.rest_voronoi_lengths[k] / cell  # a bend represents its whole cell
        made.bend_matrix[..., k] = rod.flexural_n_m2 * share * np.eye(3)
    return made


def _bend(made: Any, curvature_1_m: float, rod: SlenderRod) -> None:
    """Place it at rest with this turn per length at its bends, about y."""
    turns = np.concatenate([[0.0], np.full(rod.bends, curvature_1_m * rod.length_m / rod.bends)]).cumsum()
    c, s = np.cos(turns), np.sin(turns)
    tangents = np.stack([c, np.zeros_like(c), -s])
    made.position_collection[:, 1:] = np.cumsum(tangents * made.rest_lengths, axis=1)
    made.director_collection[2] = tangents
    made.director_collection[1] = np.cross(tangents, [0.0, 1.0, 0.0], axis=0, axisb=0).reshape(3, -1)


def _turn(made: Any) -> float:
    """Return the turn of the last element, rad."""
    tangent = made.director_collection[2, :, -1]
    return float(math.atan2(-tangent[2], tangent[0]))
