"""The section of the tube: validity and closed forms.

The tube's axis is the line y = z = 0; the bore's axis is at z = d. The wall is R − a − d thick at the top (+z) and
R − a + d at the bottom, toward which pressure bends the tube.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pliant.families import Need

# Thinner walls need more elements than the mesh has, and cannot be cast.
THINNEST_SHARE = 0.05


@dataclass(frozen=True)
class Section:
    """Radii R and a, offset d, in m."""

    outer_m: float
    bore_m: float
    offset_m: float

    @property
    def thinnest_m(self) -> float:
        """Wall at the top."""
        return self.outer_m - self.bore_m - self.offset_m

    def needs(self, length_m: float) -> Iterator[Need]:
        """Yield the conditions for a tube of this module length that can be made and meshed."""
        least = THINNEST_SHARE * self.outer_m
        thin = f"outer_radius − bore_radius − offset ≥ {THINNEST_SHARE:g} outer_radius (the thin wall)"
        yield Need(thin, self.thinnest_m, least)
        yield Need(f"module_length ≥ {THINNEST_SHARE:g} outer_radius (flat elements)", length_m, least)

    @property
    def area_m2(self) -> float:
        """Area of the wall."""
        return float(np.pi * (self.outer_m**2 - self.bore_m**2))

    @property
    def centroid_m(self) -> float:
        """Height of the wall's centroid: below the axis, since the bore is above."""
        return -(self.bore_m**2) * self.offset_m / (self.outer_m**2 - self.bore_m**2)

    @property
    def second_moment_m4(self) -> float:
        """Second moment of the wall's area about its centroid, for bending about y."""
        outer, bore = np.pi * self.outer_m**4 / 4, np.pi * self.bore_m**4 / 4
        bore += np.pi * self.bore_m**2 * self.offset_m**2
        return float(outer - bore - self.area_m2 * self.centroid_m**2)
