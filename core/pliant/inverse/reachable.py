"""The reachable set: equilibria over the whole range of the inputs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy  # scipy.stats takes half a second and is needed only for several inputs

from pliant.errors import NotReachedError
from pliant.interfaces.simulation import Simulation
from pliant.inverse.target import Target
from pliant.records.design import Array
from pliant.records.rollout import Inputs

# Number of equilibria of one input, and at most for each further one (a power of two).
OF_ONE, OF_SEVERAL, MOST = 65, 256, 2048
SEED = 0


@dataclass(frozen=True, eq=False)
class Reachable:
    """Equilibria: actuation (s, k) of `inputs`, markers (s, n + 2, 3), tip's direction (s, 3), coordinates (s, n, a).

    `inside` (s,) marks equilibria within the data of all laws.
    """

    inputs: tuple[str, ...]
    actuation: Array
    markers_m: Array
    directions: Array
    joint_angles: Array
    inside: Array

    @property
    def tips_m(self) -> Array:
        """(s, 3) positions of the tip."""
        return np.asarray(self.markers_m[:, -1])

    @property
    def limits_m(self) -> Array:
        """(3, 2) minimum and maximum of the tip's coordinates."""
        return np.stack([self.tips_m.min(axis=0), self.tips_m.max(axis=0)], axis=1)

    def distances(self, target: Target, turn_m: float) -> Array:
        """Return (s,) the squared distance of each equilibrium from a target."""
        total = np.zeros(len(self.actuation))
        if target.tip_m is not None:
            total += np.sum((self.tips_m - target.tip_m) ** 2, axis=1)
        if target.direction is not None:
            total += turn_m**2 * np.sum((self.directions - target.direction) ** 2, axis=1)
        if target.backbone_m is not None:
            total += np.sum((self.markers_m - target.backbone_m) ** 2, axis=(1, 2)) / (
                len(target.backbone_m) - 1
            )
        if target.clearance is not None:
            total += target.clearance.squared(self.markers_m)
        return total

    def write(self, path: Path) -> None:
        """Write as CSV: inputs, tip, direction, whether the laws have data."""
        names = [
            *self.inputs,
            "tip_x_m",
            "tip_y_m",
            "tip_z_m",
            "direction_x",
            "direction_y",
            "direction_z",
            "inside",
        ]
        table = np.column_stack([self.actuation, self.tips_m, self.directions, self.inside])
        lines = [",".join(names), *(",".join(f"{value:.9g}" for value in row) for row in table)]
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def sample(
    simulation: Simulation, inputs: tuple[str, ...], bounds: Array, count: int | None = None
) -> Reachable:
    """Return equilibria at even steps of one input, or at a Sobol sequence and all corners of several inputs.

    Each equilibrium is solved from a near one.

    Raises:
        NotReachedError: the chain settles nowhere.
    """
    k = len(inputs)
    if k == 1:
        shares = np.linspace(0.0, 1.0, count or OF_ONE)[:, None]
    else:
        many = count or min(MOST, OF_SEVERAL * 2 ** (k - 1))
        sobol = scipy.stats.qmc.Sobol(k, seed=SEED).random_base2(int(np.ceil(np.log2(many))))
        corners = np.indices((2,) * k).reshape(k, -1).T if k <= 8 else np.zeros((1, k))
        shares = np.concatenate([corners, sobol])
    kept, found = [], []
    start: Array | None = None
    for share in shares:
        values = bounds[:, 0] + share * np.ptp(bounds, axis=1)
        one = simulation.respond(Inputs(dict(zip(inputs, values.tolist(), strict=True))), start)
        if one.converged:
            kept.append(values)
            found.append(one)
            start = one.joint_angles
    if not found:
        raise NotReachedError("the chain settles nowhere in the bounds of its inputs; narrow them.")
    return Reachable(
        inputs,
        np.array(kept),
        np.array([one.markers_m for one in found]),
        np.array([one.tip_rotation[:, 0] for one in found]),
        np.array([one.joint_angles for one in found]),
        np.array([one.inside for one in found]),
    )
