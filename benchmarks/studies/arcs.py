"""How close four arcs alone come to the helix of the shape-matching study: what no pressure, no bellow can beat.

    python -m benchmarks.studies.arcs

A chain of four segments without weight is four arcs of constant curvature, each in a plane of its own, the first along
the base's axis. Their lengths are those of 5 to 8 modules of 4 to 6 mm, each is turned by 0 to 90° against the one
before, the base at will, and curvature has no limit. Prints RMSE and e_max for a target whose axis lies along the
base's, and for one that leaves the base along it.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from pliant_plugins.tasks import curves

RADIUS_M, HEIGHT_M, SEGMENTS = 18e-3, 60e-3, 4
PIECES, SAMPLES, STARTS = 40, 101, 40
# m, rad, rad: length, bend and turn; of the first segment the turn is the base's roll.
LOW = np.repeat([5 * 4e-3, 0.0, 0.0], SEGMENTS)
HIGH = np.repeat([8 * 6e-3, 2 * np.pi, np.pi / 2], SEGMENTS)
LOW[2 * SEGMENTS], HIGH[2 * SEGMENTS] = -np.pi, np.pi
Array = np.ndarray


def arcs(unknowns: Array) -> Array:
    """(n, 3) m: arcs that begin along x, of lengths (m), bends (rad) and turns (rad), SEGMENTS of each."""
    position, frame, points = np.zeros(3), np.eye(3), [np.zeros(3)]
    lengths, bends, turns = unknowns.reshape(3, SEGMENTS)
    for length, bend, plane in zip(lengths, bends, np.cumsum(turns), strict=True):
        axis = np.array([0.0, np.cos(plane), np.sin(plane)])
        step = Rotation.from_rotvec(axis * bend / PIECES).as_matrix()
        half = Rotation.from_rotvec(axis * bend / PIECES / 2).as_matrix()
        for _ in range(PIECES):
            position = position + frame @ half @ np.array([length / PIECES, 0.0, 0.0])
            frame = frame @ step
            points.append(position)
    return np.array(points)


def closest(target: Array) -> curves.Distances:
    """The smallest RMSE that was found, with its e_max."""
    goal, random = curves.resampled(target, SAMPLES), np.random.default_rng(1)

    def apart(unknowns: Array) -> Array:
        return 1e3 * (curves.resampled(arcs(unknowns), SAMPLES) - goal).ravel()

    best = min(
        (
            least_squares(
                apart,
                LOW + random.uniform(0.05, 0.95, 3 * SEGMENTS) * (HIGH - LOW),
                bounds=(LOW, HIGH),
                x_scale=np.repeat([1e-2, 0.3, 0.3], SEGMENTS),
            )
            for _ in range(STARTS)
        ),
        key=lambda found: float(found.cost),
    )
    return curves.Distances.between(curves.resampled(arcs(best.x), SAMPLES), goal)


def main() -> None:
    helix = curves.helix(RADIUS_M, HEIGHT_M, 1.0, True)
    for words, target in (
        ("its axis along the base's", helix),
        ("leaving the base along the base's axis", curves.leaving_along_x(helix)),
    ):
        found = closest(target)
        print(f"{words}: RMSE {1e3 * found.rmse_m:.2f} mm, e_max {1e3 * found.e_max_m:.2f} mm")


if __name__ == "__main__":
    main()
