"""Target curves and distances between curves, point by point at the same share of their lengths."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pliant.errors import UserError
from pliant.mechanics.rotations import exp_map
from pliant.records.design import Array
from pliant_tables.opening import open_sheet
from pliant_tables.schema import Known, Schema, read_columns

# Points of a curve that are kept for pictures.
DRAWN = 61
COLUMNS = ("x_m", "y_m", "z_m")
POINTS = Schema(tuple(Known(axis, "_m", "m", "output") for axis in "xyz"), ",".join(COLUMNS))


def helix(radius_m: float, height_m: float, turns: float, right_handed: bool, count: int = 1001) -> Array:
    """Return a helix (count, 3) from the origin along +x; its axis is at z = −radius, the side of positive bending."""
    angle = 2 * np.pi * turns * np.linspace(0.0, 1.0, count)
    # A turn about +x takes +z to −y.
    side = -np.sin(angle) if right_handed else np.sin(angle)
    return np.stack(
        [np.linspace(0.0, height_m, count), radius_m * side, radius_m * (np.cos(angle) - 1.0)], axis=1
    )


def leaving_along_x(points: Array) -> Array:
    """Return the points (n, 3), turned about the first by the smallest rotation of their first step to +x."""
    first = points[1] - points[0]
    axis = np.cross(first, [1.0, 0.0, 0.0])
    sine = float(np.linalg.norm(axis))
    if sine < 1e-12 * float(np.linalg.norm(first)):
        return points
    turn = exp_map(axis / sine * np.arctan2(sine, first[0]))
    return np.asarray(points[0] + (points - points[0]) @ turn.T)


def read_points(path: Path) -> Array:
    """Read (n, 3) points of a CSV with the columns x_m, y_m, z_m, or in other units.

    Raises:
        UserError: the file, its columns or a number is wrong; or it has fewer than two different points.
    """
    with open_sheet(path, POINTS.example) as sheet:
        columns = POINTS.matched(path, sheet.header)
        if missing := [name for name in COLUMNS if name not in columns]:
            raise UserError(f"{path} has no column {missing[0]}; a curve needs x_m, y_m and z_m.")
        rows = read_columns(sheet, columns)
    points = np.stack([rows.numbers[name] for name in COLUMNS], axis=1)
    for row, k in np.argwhere(np.isnan(points)).tolist():
        raise UserError(f"{path}, line {rows.lines[row]}: {COLUMNS[k]} is blank; it needs a finite number.")
    if len(points) < 2 or not np.ptp(points, axis=0).any():
        raise UserError(f"{path} has fewer than two different points; a curve needs at least two.")
    return points


def resampled(points: Array, count: int) -> Array:
    """Return points (count, 3) of a polyline (n, 3) at equal steps of its length, both ends included."""
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    reach = np.concatenate([[0.0], np.cumsum(steps)])
    wanted = np.linspace(0.0, reach[-1], count)
    return np.stack([np.interp(wanted, reach, points[:, k]) for k in range(3)], axis=1)


def length_m(points: Array) -> float:
    """Return length of a polyline."""
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def best_roll(points: Array, target: Array) -> float:
    """Return the turn (rad) of the target about x that brings it closest to the points in the mean square.

    Both (n, 3), point by point; the optimum is in closed form, as in Kabsch's problem in a plane.
    """
    (y, z), (v, w) = points[:, 1:].T, target[:, 1:].T
    return float(np.arctan2(np.sum(z * v - y * w), np.sum(y * v + z * w)))


def rolled(points: Array, angle_rad: float) -> Array:
    """Return the points (n, 3) turned about x."""
    return np.asarray(points @ exp_map(np.array([angle_rad, 0.0, 0.0])).T)


@dataclass(frozen=True)
class Distances:
    """Distances between two curves at the same shares of their lengths, m."""

    rmse_m: float
    mean_m: float
    e_max_m: float

    @staticmethod
    def between(points: Array, target: Array) -> Distances:
        """Return distances of points (n, 3) to those of the target with the same numbers."""
        apart = np.linalg.norm(points - target, axis=1)
        return Distances(float(np.sqrt(np.mean(apart**2))), float(apart.mean()), float(apart.max()))
