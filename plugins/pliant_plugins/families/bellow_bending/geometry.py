"""The bending bellow as a solid: profile, validity, closed-form volumes.

The wall lies outside the profile, with thickness t along its normal. A solid plate, 2t thick and 2R wide, is
fused to the crests: it reaches from z = −Rc to z = −Rc − 2t below the tube's axis.
Source of the shape: Yao, Howard, Maiolino (2026), doi 10.1002/aisy.70406.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pliant.errors import InvalidDesignError
from pliant_plugins.families.bellow.profile import BellowProfile, mm


@dataclass(frozen=True)
class BellowGeometry(BellowProfile):
    """Radii r and R, wall thickness t and module length l, in m."""

    @property
    def axis_height_m(self) -> float:
        """z of the tube's axis in the module frame: Rc + t above the plate's mid-plane."""
        return self.crest_radius_m + self.wall_m

    def check(self) -> None:
        """Raise `InvalidDesignError`, with the broken inequality and by how much, unless the solid exists."""
        self.check_profile("bellow_bending")
        t, l = self.wall_m, self.module_length_m  # noqa: E741
        slack = l / 4 - t
        if slack <= 1e-6 * l:
            raise InvalidDesignError(
                f"bellow_bending needs module_length/4 > wall (or the trough's outer arc collapses), "
                f"but {mm(l / 4)} ≤ {mm(t)}, short by {mm(abs(slack))}."
            )

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
        """Volume (m³) of one module's cavity."""
        return self.enclosed_volume(0.0)
