"""The camera's position: a named direction, at the distance from which everything fits."""

from __future__ import annotations

import mujoco
import numpy as np

from pliant.records.design import Array

# Degrees: azimuth 90 looks along world +y, with x to the right; elevation is negative from above.
VIEWS = {"front": (90.0, -6.0), "side": (180.0, -6.0), "top": (90.0, -89.0), "iso": (125.0, -20.0)}
MARGIN = 1.08


def camera(view: str, points: Array, fovy_deg: float, size: tuple[int, int]) -> mujoco.MjvCamera:
    """Return a camera that looks along a view of `VIEWS` and sees all points (k, 3) in a picture of this size."""
    azimuth, elevation = VIEWS[view]
    forward, right, up = _axes(azimuth, elevation)
    centre = 0.5 * (points.max(axis=0) + points.min(axis=0))
    tall = np.tan(np.radians(fovy_deg) / 2) / MARGIN
    wide = tall * size[0] / size[1]
    # Centre the points in the picture, then move back until the widest of them fits.
    for _ in range(8):
        away = points - centre
        x, y, depth = away @ right, away @ up, away @ forward
        distance = float(max((np.abs(x) / wide - depth).max(), (np.abs(y) / tall - depth).max()))
        seen_x, seen_y = x / (distance + depth), y / (distance + depth)
        shift_x, shift_y = seen_x.max() + seen_x.min(), seen_y.max() + seen_y.min()
        centre = centre + 0.5 * distance * (shift_x * right + shift_y * up)
    made = mujoco.MjvCamera()
    made.type = mujoco.mjtCamera.mjCAMERA_FREE
    made.azimuth, made.elevation, made.distance = azimuth, elevation, distance
    made.lookat[:] = centre
    return made


def _axes(azimuth_deg: float, elevation_deg: float) -> tuple[Array, Array, Array]:
    """Return forward, right and up of MuJoCo's free camera."""
    a, e = np.radians(azimuth_deg), np.radians(elevation_deg)
    forward = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    right = np.array([np.sin(a), -np.cos(a), 0.0])
    return forward, right, np.cross(right, forward)
