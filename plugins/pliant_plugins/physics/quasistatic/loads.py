"""Compiled: where a chain of hinges is, and the moments of the forces on it.

Frames are turned so that every joint is a hinge about its own third axis. 3 × 3 products are written in scalars: the
compiler keeps these in registers.
"""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, forceinline=True, error_model="numpy")
def pose(q, base, body, axes, origins, points):  # type: ignore[no-untyped-def]
    """Fills axes (n, 3), origins (n, 3) and points (n + 1, 3) of the moving bodies and the tip."""
    position, _, offsets, rests, straight, arms, _ = body
    n = len(q)
    x, y, z = position[0], position[1], position[2]
    xx, xy, xz = base[0, 0], base[0, 1], base[0, 2]
    yx, yy, yz = base[1, 0], base[1, 1], base[1, 2]
    zx, zy, zz = base[2, 0], base[2, 1], base[2, 2]
    for i in range(n):
        a, b, c = offsets[i, 0], offsets[i, 1], offsets[i, 2]
        x, y, z = x + xx * a + xy * b + xz * c, y + yx * a + yy * b + yz * c, z + zx * a + zy * b + zz * c
        if not straight[i]:
            rest = rests[i]
            a, b, c = rest[0, 0], rest[1, 0], rest[2, 0]
            x0, y0, z0 = xx * a + xy * b + xz * c, yx * a + yy * b + yz * c, zx * a + zy * b + zz * c
            a, b, c = rest[0, 1], rest[1, 1], rest[2, 1]
            x1, y1, z1 = xx * a + xy * b + xz * c, yx * a + yy * b + yz * c, zx * a + zy * b + zz * c
            a, b, c = rest[0, 2], rest[1, 2], rest[2, 2]
            x2, y2, z2 = xx * a + xy * b + xz * c, yx * a + yy * b + yz * c, zx * a + zy * b + zz * c
            xx, xy, xz, yx, yy, yz, zx, zy, zz = x0, x1, x2, y0, y1, y2, z0, z1, z2
        cosine, sine = np.cos(q[i]), np.sin(q[i])
        xx, xy = cosine * xx + sine * xy, cosine * xy - sine * xx
        yx, yy = cosine * yx + sine * yy, cosine * yy - sine * yx
        zx, zy = cosine * zx + sine * zy, cosine * zy - sine * zx
        axes[i, 0], axes[i, 1], axes[i, 2] = xz, yz, zz
        origins[i, 0], origins[i, 1], origins[i, 2] = x, y, z
        a, b, c = arms[i, 0], arms[i, 1], arms[i, 2]
        points[i, 0] = x + xx * a + xy * b + xz * c
        points[i, 1] = y + yx * a + yy * b + yz * c
        points[i, 2] = z + zx * a + zy * b + zz * c
    a, b, c = arms[n, 0], arms[n, 1], arms[n, 2]
    points[n, 0] = x + xx * a + xy * b + xz * c
    points[n, 1] = y + yx * a + yy * b + yz * c
    points[n, 2] = z + zx * a + zy * b + zz * c


@njit(cache=True, forceinline=True, error_model="numpy")
def weigh(axes, origins, points, masses, payload, gravity, force, load, turned):  # type: ignore[no-untyped-def]
    """Fills the generalised loads (n,), and `turned` (n, 3), whose products with axes are their derivatives.

    With T = Σ (x − o) Fᵀ of the points beyond joint i: load a · ax(T), turned (T − tr T) a.
    """
    n = len(load)
    tx = ty = tz = xx = xy = xz = yx = yy = yz = zx = zy = zz = 0.0
    for i in range(n, -1, -1):
        mass = payload if i == n else masses[i]
        fx, fy, fz = mass * gravity[0], mass * gravity[1], mass * gravity[2]
        if i == n:
            fx, fy, fz = fx + force[0], fy + force[1], fz + force[2]
        tx, ty, tz = tx + fx, ty + fy, tz + fz
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        xx, xy, xz = xx + x * fx, xy + x * fy, xz + x * fz
        yx, yy, yz = yx + y * fx, yy + y * fy, yz + y * fz
        zx, zy, zz = zx + z * fx, zy + z * fy, zz + z * fz
        if i == n:
            continue
        x, y, z = origins[i, 0], origins[i, 1], origins[i, 2]
        a, b, c = axes[i, 0], axes[i, 1], axes[i, 2]
        d, e, f = xx - x * tx, yy - y * ty, zz - z * tz
        txy, txz, tyz = xy - x * ty, xz - x * tz, yz - y * tz
        tyx, tzx, tzy = yx - y * tx, zx - z * tx, zy - z * ty
        load[i] = a * (tyz - tzy) + b * (tzx - txz) + c * (txy - tyx)
        turned[i, 0] = txy * b + txz * c - (e + f) * a
        turned[i, 1] = tyx * a + tyz * c - (d + f) * b
        turned[i, 2] = tzx * a + tzy * b - (d + e) * c
