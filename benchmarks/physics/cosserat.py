"""The linear-law helix as a Cosserat rod in PyElastica (Gazzola et al. 2018), shear and stretch suppressed.

A module of length l with the joint stiffness K and the free angles u₀ becomes a stretch of rod with the bending
and twist stiffness K l and the rest curvature u₀ / l. The rotation of a segment turns both about the rod's axis,
in one director field without twist. Bends stand in the middle of equal cells of length l / k, as the chain's
joints do with k = 1, so that the rod's discretisation error is O(1/k²).
"""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import elastica
import numpy as np
from benchmarks.physics.helix import G_M_S2, PRESSURE_PA, SEGMENTS, SegmentSpec, helix

from pliant.records.design import Array
from pliant_plugins.surrogates.polynomial.axes import AxesLaw

# The chain's axes y, z, x are the rod's directors 1, 2, 3.
DIRECTORS = [1, 2, 0]
COURANT = 0.8
SAMPLE_STEPS = 50


@dataclass(frozen=True)
class RodOptions:
    """Cells per module, stiffness against stretch and shear (N), uniform damping rate (1/s), time simulated."""

    cells: int
    axial_n: float
    damping_per_s: float = 25.0
    duration_s: float = 0.9


# Tuned for speed: as many bends as the chain has joints; 0.07 % of stretch is 0.06 mm at the tip.
FAST = RodOptions(cells=1, axial_n=4e2)
FINE = RodOptions(cells=4, axial_n=2e3, duration_s=2.2)
COMPILING = RodOptions(cells=1, axial_n=4e2, duration_s=1e-3)


@dataclass(frozen=True, eq=False)
class SettledRod:
    """tip_m (3,) at the end; the tip every SAMPLE_STEPS steps (t, 3) with the CPU time; steps in all."""

    tip_m: Array
    history_m: Array
    cpu_s: Array
    steps: int
    longest_stretch: float

    def settled_after_s(self, within_m: float) -> float:
        """Return the CPU time after which the tip stays within this distance of its final position."""
        away = np.linalg.norm(self.history_m - self.tip_m, axis=1) > within_m
        last = int(np.flatnonzero(away)[-1]) + 1 if away.any() else 0
        return float(self.cpu_s[min(last, len(self.cpu_s) - 1)])


class Rods(elastica.BaseSystemCollection, elastica.Constraints, elastica.Forcing, elastica.Damping):
    """The simulator class that PyElastica requires, with the features used."""


def settle_rod(
    law: AxesLaw, load_kg: float, options: RodOptions, segments: Sequence[SegmentSpec] = SEGMENTS
) -> SettledRod:
    """Settle the rod from its straight shape under pressure, its weight and a tip force, by damping."""
    rod = _rod(law, options, segments)
    cell = float(np.min(np.diff(np.linalg.norm(rod.position_collection, axis=0))))
    step = COURANT * cell * math.sqrt(float(rod.mass.sum()) / float(rod.rest_lengths.sum()) / options.axial_n)
    system: Any = Rods()
    system.append(rod)
    clamped = {"constrained_position_idx": (0,), "constrained_director_idx": (0,)}
    damping = {"uniform_damping_constant": options.damping_per_s, "time_step": step}
    weight = np.array([0.0, 0.0, -G_M_S2])
    tip = (np.zeros(3), load_kg * weight)
    system.constrain(rod).using(elastica.OneEndFixedBC, **clamped)
    system.add_forcing_to(rod).using(elastica.GravityForces, acc_gravity=weight)
    system.add_forcing_to(rod).using(elastica.EndpointForces, *tip, ramp_up_time=1e-9)
    system.dampen(rod).using(elastica.AnalyticalLinearDamper, **damping)
    system.finalize()
    stepper = elastica.PositionVerlet()
    tips, times = [], []
    steps = math.ceil(options.duration_s / step / SAMPLE_STEPS) * SAMPLE_STEPS
    now = np.float64(0.0)
    start = time.process_time()
    for k in range(steps):
        now = stepper.step(system, now, np.float64(step))
        if k % SAMPLE_STEPS == SAMPLE_STEPS - 1:
            tips.append(rod.position_collection[:, -1].copy())
            times.append(time.process_time() - start)
    stretch = float(np.abs(rod.dilatation - 1.0).max())
    return SettledRod(tips[-1], np.array(tips), np.array(times), steps, stretch)


def _rod(law: AxesLaw, options: RodOptions, segments: Sequence[SegmentSpec]) -> Any:
    """Build elements of half a cell, whole cells and half a cell: bends are in the middles of the cells."""
    cells = [spec for spec in segments for _ in range(spec.modules * options.cells)]
    lengths = np.array([spec.length_m for spec in cells]) / options.cells
    elements = np.concatenate([[lengths[0] / 2], (lengths[1:] + lengths[:-1]) / 2, [lengths[-1] / 2]])
    base = helix(law).base_rotation
    along = base[:, 0]
    nodes = np.concatenate([[0.0], np.cumsum(elements)])
    radius = float(np.mean([spec.radius_m for spec in cells]))
    # PyElastica calls inertias of grams and millimetres suspicious, on the root logger.
    logging.disable(logging.WARNING)
    frame = (np.zeros(3), along, base[:, 1].copy())
    stiff = {"youngs_modulus": 1.0, "shear_modulus": 1.0, "position": np.outer(along, nodes)}
    make = elastica.CosseratRod.straight_rod
    rod = make(len(elements), *frame, float(nodes[-1]), radius, 1.0, **stiff)
    logging.disable(logging.NOTSET)
    weigh(rod, elements, nodes, lengths, np.array([s.mass_kg / s.length_m for s in cells]), radius)
    for k in range(len(elements)):
        rod.shear_matrix[..., k] = options.axial_n * np.eye(3)
    stiffness, rest = _module(law)
    for k, spec in enumerate(cells):
        # Each bend represents its whole cell, whatever share of it PyElastica assigns to the node.
        share = rod.rest_voronoi_lengths[k] / lengths[k]
        c, s = math.cos(spec.rotation_rad), math.sin(spec.rotation_rad)
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])  # about director 3
        rod.bend_matrix[..., k] = turn @ (stiffness * spec.length_m) @ turn.T * share
        rod.rest_kappa[:, k] = turn @ rest / spec.length_m / share
    return rod


def weigh(rod: Any, elements: Array, nodes: Array, cells: Array, density: Array, radius: float) -> None:
    """Set masses of the nodes and inertias of the elements; `density` in kg/m is that of the cells."""
    ends = np.concatenate([[0.0], np.cumsum(cells)])
    mass_before = np.concatenate([[0.0], np.cumsum(density * cells)])
    mass = np.diff(np.interp(nodes, ends, mass_before))
    rod.mass[:] = 0.0
    rod.mass[:-1] += mass / 2
    rod.mass[1:] += mass / 2
    across = mass * radius**2 / 4
    for k in range(len(elements)):
        inertia = np.diag([across[k], across[k], 2 * across[k]])
        rod.mass_second_moment_of_inertia[..., k] = inertia
        rod.inv_mass_second_moment_of_inertia[..., k] = np.linalg.inv(inertia)


def _module(law: AxesLaw) -> tuple[Array, Array]:
    """Return joint stiffness (3, 3) and free angles (3,) of a linear law, in the order of the directors."""
    effort = law.evaluate(np.array([PRESSURE_PA]), np.zeros((1, 3)))
    stiffness = -effort.dtau_du[0]
    free = np.linalg.solve(stiffness, effort.tau[0])
    return stiffness[np.ix_(DIRECTORS, DIRECTORS)], free[DIRECTORS]
