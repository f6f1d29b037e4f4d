"""The published FEM of one tendon joint (Yao, Howard, Maiolino 2026, doi 10.1002/aisy.70406), and what it says itself.

Read off the data, before any model:
- M is linear in T at a held angle, M = T arm(θ) − S(θ), with S close to 0.095 N·m/rad · θ;
- past θ ≈ −0.02 rad the moment rises several times as steeply: a stop, which no model here has (`lip`);
- four of the eight free points that have a constrained branch lie 4 to 10 mrad below where it leads as M → 0, the
  others within 0.3 mrad (`free_gaps`): the free branch carries errors of up to 2 %;
- the last free point, 7.925 N, lies beyond a second stop: dθ/dT falls from 0.157 to 0.088 rad/N before it.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass

import numpy as np
from benchmarks.output import REFERENCE, reference_table
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
STOP_RAD = -0.02  # rows below are past the stop
FREE_TOP_N = 7.5  # free points up to here are fitted: all but the last
TENDON_AT_REST_M = 27.297e-3  # published, constant of the length of the tendon at a joint


@dataclass(frozen=True, eq=False)
class Published:
    """Rows of the table, (n,) each; `free` marks those without external moment."""

    force_n: Array
    angle_rad: Array
    moment_n_m: Array

    @property
    def free(self) -> Mask:
        return self.moment_n_m == 0

    @property
    def fitted(self) -> Mask:
        """Free points before the second stop, rest aside."""
        return self.free & (self.force_n > 0) & (self.force_n <= FREE_TOP_N)

    @property
    def between_stops(self) -> Mask:
        """Constrained rows that the model describes."""
        return ~self.free & (self.angle_rad > STOP_RAD)

    @property
    def forces_n(self) -> Array:
        """Tendon forces of the constrained branches."""
        return np.unique(self.force_n[~self.free])

    def at_angle(self, angle_rad: float) -> tuple[float, float]:
        """(arm in m, S in N·m) at a held angle: the line M = T arm − S through the branches that reach it."""
        forces, moments = [], []
        for force in self.forces_n:
            rows = np.flatnonzero((self.force_n == force) & ~self.free)
            rows = rows[np.argsort(self.angle_rad[rows])]
            if self.angle_rad[rows[0]] <= angle_rad <= self.angle_rad[rows[-1]]:
                forces.append(force)
                moments.append(np.interp(angle_rad, self.angle_rad[rows], self.moment_n_m[rows]))
        arm, offset = np.polyfit(forces, moments, 1)
        return float(arm), -float(offset)

    def free_gaps(self) -> dict[str, float]:
        """Free angle less that of the force's own constrained branch carried on to M = 0, rad, by force.

        The continuation is a parabola through eight rows; the first, which some of the free points share their
        error with, is left out.
        """
        gaps = {}
        for force in self.forces_n:
            rows = np.flatnonzero((self.force_n == force) & ~self.free)
            rows = rows[np.argsort(self.moment_n_m[rows])][1:9]
            at_zero = np.polyfit(self.moment_n_m[rows], self.angle_rad[rows], 2)[-1]
            free = self.angle_rad[self.free & (self.force_n == force)][0]
            gaps[f"{force:g}"] = float(free - at_zero)
        return gaps

    def lip(self) -> dict[str, float]:
        """The stop: M = T arm − S past it, compared with M between the stops carried on to the same angles.

        Links that meet on a lip at height d above the mid-plane turn about it and stretch the flexure: the arm
        grows by d, the stiffness from EI/c to EI/c + d² EA/c = (1 + 12 d²/t²) EI/c, which gives t.
        """
        past = ~self.free & (self.angle_rad < STOP_RAD)
        design = np.column_stack(
            [
                self.force_n[past],
                -np.ones(past.sum()),
                -self.angle_rad[past],
                (self.force_n * self.angle_rad)[past],
            ]
        )
        arm, _, stiffness, growth = np.linalg.lstsq(design, self.moment_n_m[past], rcond=None)[0]
        angle, force = float(self.angle_rad[past].mean()), float(self.force_n[past].mean())
        near = [self.at_angle(u) for u in (0.02, 0.1)]
        slope = (near[1][0] - near[0][0]) / 0.08
        elastic = (near[1][1] - near[0][1]) / 0.08
        rise = float(arm + growth * angle) - (near[0][0] + slope * (angle - 0.02))
        ratio = 1 + float(stiffness - growth * force - (elastic - slope * force)) / elastic
        return {
            "arm_rise_m": rise,
            "stiffness_ratio": ratio,
            "thickness_m": rise * float(np.sqrt(12 / (ratio - 1))),
        }

    def error(self, predicted_n_m: Array, rows: Mask) -> float:
        """RMS of the moment's error over the RMS of the moment, over rows."""
        error = predicted_n_m[rows] - self.moment_n_m[rows]
        return float(np.linalg.norm(error) / np.linalg.norm(self.moment_n_m[rows]))


def published_arm_m(angle_rad: float) -> float:
    """−dL/dθ of the published L(θ) = −1.2698 θ² − 2.4933 θ + 27.297 mm."""
    return (2.4933 + 2 * 1.2698 * angle_rad) * 1e-3


def published() -> Published:
    """The table; ends the program with a sentence where it is absent."""
    table = reference_table("tendon_joint_fem.csv")
    if table is None:
        sys.exit(f"tendon_joint: the reference data are absent: {REFERENCE} (see docs: reference study)")
    return Published(*(table[name] for name in ("tendon_force_n", "joint_angle_rad", "moment_n_m")))
