"""The bellow's profile: arcs and flanks, points at an offset from it, closed-form volumes, validity.

Half a convolution runs from mid-crest (x = 0) to mid-trough (x = l/2). The profile is a quarter circle of radius
a = l/4 at the crest (radius Rc = 2R − r), a straight radial flank and a quarter circle at the trough (radius r).
`depth` is the distance outward along the profile's normal. The family chooses the position of the wall: on one side of
the profile or on both. Source of the shape: Yao, Howard, Maiolino (2026), doi 10.1002/aisy.70406.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pliant.families import Need
from pliant.records.design import Array


@dataclass(frozen=True)
class BellowProfile:
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
        """Rc = 2R − r, the profile's radius at the crest."""
        return 2 * self.average_radius_m - self.inner_radius_m

    @property
    def flank_m(self) -> float:
        """Length of the straight radial flank, 2R − 2r − l/2; rounding of a zero flank is removed."""
        flank = 2 * (self.average_radius_m - self.inner_radius_m) - self.half_length_m
        return flank if flank > 1e-6 * self.module_length_m else 0.0

    def wall_volume(self, inner: float, outer: float) -> float:
        """Return volume (m³) of one module's wall between two offsets of the profile, in closed form.

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

    def enclosed_volume(self, depth: float = 0.0) -> float:
        """Return volume (m³) inside one module's profile at an offset, by Pappus' theorem over its parts.

        With centres c = Rc − a (crest) and b = r + a (trough), ∫ρ² dx is exact over each quarter circle.
        """
        c, b = self.crest_radius_m - self.arc_radius_m, self.inner_radius_m + self.arc_radius_m
        wide, narrow = self.arc_radius_m + depth, self.arc_radius_m - depth
        crest = wide * c**2 + np.pi / 2 * c * wide**2 + 2 / 3 * wide**3
        trough = narrow * b**2 - np.pi / 2 * b * narrow**2 + 2 / 3 * narrow**3
        return float(2 * np.pi * (crest + trough))

    def crest(self, angle: Array, depth: Array) -> tuple[Array, Array]:
        """Return (x, radius) on the crest's arc, `angle` from 0 at mid-crest to π/2."""
        arc = self.arc_radius_m
        return (arc + depth) * np.sin(angle), self.crest_radius_m - arc + (arc + depth) * np.cos(angle)

    def flank(self, fraction: Array, depth: Array) -> tuple[Array, Array]:
        """Return (x, radius) on the flank, `fraction` from 0 at the crest to 1 at the trough."""
        outer = self.crest_radius_m - self.arc_radius_m
        return self.arc_radius_m + depth + 0 * fraction, outer - self.flank_m * fraction + 0 * depth

    def trough(self, angle: Array, depth: Array) -> tuple[Array, Array]:
        """Return (x, radius) on the trough's arc, `angle` from 0 at the flank to π/2 at mid-trough."""
        arc = self.arc_radius_m
        x = self.half_length_m - (arc - depth) * np.cos(angle)
        return x, self.inner_radius_m + arc - (arc - depth) * np.sin(angle)

    def radius_at(self, x: Array, depth: float) -> Array:
        """Return radius of the profile at an offset, by x ∈ [0, l/2] from mid-crest."""
        wide, narrow = self.arc_radius_m + depth, self.arc_radius_m - depth
        crest = self.crest_radius_m - self.arc_radius_m + np.sqrt(np.maximum(wide**2 - x**2, 0.0))
        left = self.half_length_m - x
        trough = self.inner_radius_m + self.arc_radius_m - np.sqrt(np.maximum(narrow**2 - left**2, 0.0))
        return np.where(x < wide, crest, trough)

    def profile_needs(self) -> Iterator[Need]:
        """Yield the conditions of a profile besides positive lengths."""
        arcs = "average_radius − inner_radius ≥ module_length/4 (room for the arcs)"
        yield Need(arcs, self.average_radius_m - self.inner_radius_m, self.arc_radius_m)

    def mid_surface_needs(self) -> Iterator[Need]:
        """Yield `profile_needs`, and the conditions of a wall from −t/2 to t/2 about the profile."""
        yield from self.profile_needs()
        half = self.wall_m / 2
        yield Need("module_length/4 > wall/2 (or the arcs' inner side collapses)", self.arc_radius_m, half)
        yield Need("inner_radius > wall/2 (or the trough closes)", self.inner_radius_m, half)
