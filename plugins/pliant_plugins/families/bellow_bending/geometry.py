"""The bending bellow as a solid: profile, validity, closed-form volumes.

Half a convolution runs from mid-crest (x = 0) to mid-trough (x = l/2). Its inner profile is a quarter circle
of radius a = l/4 at the crest (inner radius Rc = 2R − r), a straight radial flank and a quarter circle at the
trough (inner radius r). The wall lies outside, with thickness t along the profile's normal. A solid plate,
2t thick and 2R wide, is fused to the crests: it reaches from z = −Rc to z = −Rc − 2t below the tube's axis.
Source of the shape: Yao, Howard, Maiolino (2026), doi 10.1002/aisy.70406.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pliant.errors import InvalidDesignError
from pliant.records.design import Array

LARGEST_MODULE_M = 1.0


@dataclass(frozen=True)
class BellowGeometry:
    """Radii r and R, wall thickness t and module length l, in m."""

    inner_radius_m: float
    average_radius_m: float
    wall_m: float
    module_length_m: float

    @property
    def arc_radius_m(self) -> float:
        """a = l/4, radius of the profile's arcs."""
        return self.module_length_m / 4

    @property
    def half_length_m(self) -> float:
        """l/2, from mid-crest to mid-trough."""
        return self.module_length_m / 2

    @property
    def crest_radius_m(self) -> float:
        """Rc = 2R − r, inner radius of the crest."""
        return 2 * self.average_radius_m - self.inner_radius_m

    @property
    def flank_m(self) -> float:
        """Length of the straight radial flank, 2R − 2r − l/2; rounding of a zero flank is removed."""
        flank = 2 * (self.average_radius_m - self.inner_radius_m) - self.half_length_m
        return flank if flank > 1e-6 * self.module_length_m else 0.0

    @property
    def axis_height_m(self) -> float:
        """z of the tube's axis in the module frame: Rc + t above the plate's mid-plane."""
        return self.crest_radius_m + self.wall_m

    def check(self) -> None:
        """Raise `InvalidDesignError`, with the broken inequality and by how much, unless the solid exists."""
        r, R, t, l = self.inner_radius_m, self.average_radius_m, self.wall_m, self.module_length_m  # noqa: E741
        for name, value in (
            ("inner_radius", r),
            ("average_radius", R),
            ("wall", t),
            ("module_length", l),
        ):
            if not value > 0:
                raise InvalidDesignError(
                    f"bellow_bending needs {name} > 0, but {name} = {_mm(value)}, short by {_mm(abs(value))}."
                )
        size = max(l, 2 * (self.crest_radius_m + t))
        if size > LARGEST_MODULE_M:
            raise InvalidDesignError(
                f"bellow_bending needs module_length and outer diameter ≤ {_mm(LARGEST_MODULE_M)}, "
                f"but the larger is {_mm(size)}, over by {_mm(size - LARGEST_MODULE_M)} "
                "(were units forgotten: bare numbers are metres, write '11 mm')."
            )
        slack = (R - r) - l / 4
        if slack < -1e-6 * l:
            raise InvalidDesignError(
                f"bellow_bending needs average_radius − inner_radius ≥ module_length/4 (room for the arcs), "
                f"but {_mm(R - r)} < {_mm(l / 4)}, short by {_mm(-slack)}."
            )
        slack = l / 4 - t
        if slack <= 1e-6 * l:
            raise InvalidDesignError(
                f"bellow_bending needs module_length/4 > wall (or the trough's outer arc collapses), "
                f"but {_mm(l / 4)} ≤ {_mm(t)}, short by {_mm(abs(slack))}."
            )

    def wall_volume(self, inner: float, outer: float) -> float:
        """Volume (m³) of one module's wall between two offsets of the profile, in closed form.

        Pappus: ∫ 2π ρ dA over two crest arcs, two flanks and two trough arcs. With inner = −t/2, outer = t/2
        (the profile as mid-surface) it is the published bellow volume 2 (V1 + V2 + V3).
        """
        r, a, f = self.inner_radius_m, self.arc_radius_m, self.flank_m
        linear, square, cube = (outer**n - inner**n for n in (1, 2, 3))
        # ∫ (a ± d) dd and ∫ (a ± d)² dd over the offsets d
        crest_1, trough_1 = a * linear + square / 2, a * linear - square / 2
        crest_2 = a**2 * linear + a * square + cube / 3
        trough_2 = a**2 * linear - a * square + cube / 3
        trough = (r + a) * np.pi / 2 * trough_1 - trough_2
        crest = (r + a + f) * np.pi / 2 * crest_1 + crest_2
        flank = linear * ((r + a) * f + f**2 / 2)
        return float(4 * np.pi * (trough + flank + crest))

    def plate_volume(self) -> float:
        """Volume (m³) of one module's plate, 2t · 2R · l."""
        return 2 * self.wall_m * 2 * self.average_radius_m * self.module_length_m

    def overlap_volume(self, points: int = 64) -> float:
        """Volume (m³) that wall and plate of one module share: the crest sunk into the plate.

        At x the wall's outer radius is ρ(x) = Rc − a + √((a + t)² − x²); the circle's segment beyond z = −Rc,
        cut at |y| ≤ R, is integrated over x by Gauss quadrature in the arc's angle.
        """
        a, t, Rc, R = self.arc_radius_m, self.wall_m, self.crest_radius_m, self.average_radius_m
        node, weight = np.polynomial.legendre.leggauss(points)
        last = np.arccos(a / (a + t))
        angle = last * (node + 1) / 2
        rho = Rc - a + (a + t) * np.cos(angle)
        chord = np.sqrt(np.maximum(rho**2 - Rc**2, 0.0))
        half_width = np.minimum(chord, R)
        # ∫0..w (√(ρ² − y²) − Rc) dy, twice for both signs of y
        segment = half_width * np.sqrt(rho**2 - half_width**2) + rho**2 * np.arcsin(half_width / rho)
        area = segment - 2 * Rc * half_width
        dx = (a + t) * np.cos(angle) * last / 2
        return float(2 * np.sum(weight * area * dx))

    def solid_volume(self) -> float:
        """Volume (m³) of one module's material: wall and plate, their overlap counted once."""
        return self.wall_volume(0.0, self.wall_m) + self.plate_volume() - self.overlap_volume()

    def cavity_volume(self) -> float:
        """Volume (m³) of one module's cavity, by Pappus' theorem over the inner profile's parts.

        With centres c = Rc − a (crest) and b = r + a (trough), ∫ρ² dx is exact over each quarter circle.
        """
        a = self.arc_radius_m
        c, b = self.crest_radius_m - a, self.inner_radius_m + a
        crest = a * c**2 + np.pi / 2 * c * a**2 + 2 / 3 * a**3
        trough = a * b**2 - np.pi / 2 * b * a**2 + 2 / 3 * a**3
        return float(2 * np.pi * (crest + trough))

    def crest(self, angle: Array, depth: Array) -> tuple[Array, Array]:
        """(x, radius) on the crest's arc, `angle` from mid-crest, `depth` ∈ [0, t] outside the cavity."""
        arc = self.arc_radius_m
        return (arc + depth) * np.sin(angle), self.crest_radius_m - arc + (arc + depth) * np.cos(angle)

    def flank(self, fraction: Array, depth: Array) -> tuple[Array, Array]:
        """(x, radius) on the flank, `fraction` from 0 at the crest to 1 at the trough."""
        outer = self.crest_radius_m - self.arc_radius_m
        return self.arc_radius_m + depth + 0 * fraction, outer - self.flank_m * fraction + 0 * depth

    def trough(self, angle: Array, depth: Array) -> tuple[Array, Array]:
        """(x, radius) on the trough's arc, `angle` from 0 at the flank to π/2 at mid-trough."""
        arc = self.arc_radius_m
        x = self.half_length_m - (arc - depth) * np.cos(angle)
        return x, self.inner_radius_m + arc - (arc - depth) * np.sin(angle)


def _mm(length_m: float) -> str:
    return f"{1e3 * length_m:.6g} mm"
