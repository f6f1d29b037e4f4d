"""The section of the tube: validity and closed forms.

The tube's axis is the line y = z = 0; the bore's axis lies at z = d. The wall is R − a − d thick at the top (+z) and
R − a + d at the bottom, toward which pressure bends the tube.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pliant.errors import InvalidDesignError

# Thinner walls need more elements than the mesh has, and cannot be cast.
THINNEST_SHARE = 0.05
LARGEST_M = 1.0


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

    def check(self, length_m: float) -> None:
        """Raise `InvalidDesignError`, with the inequality and by how much, unless the tube can be made."""
        named = {
            "outer_radius": self.outer_m,
            "bore_radius": self.bore_m,
            "offset": self.offset_m,
            "module_length": length_m,
        }
        for name, value in named.items():
            if not value > 0:
                raise InvalidDesignError(
                    f"eccentric_tube needs {name} > 0, but it is {_mm(value)}, short by {_mm(abs(value))}."
                )
            if value > LARGEST_M:
                raise InvalidDesignError(
                    f"eccentric_tube needs {name} ≤ {_mm(LARGEST_M)}, but it is {_mm(value)}, over by "
                    f"{_mm(value - LARGEST_M)}: were units forgotten? Bare numbers are metres; write '6 mm'."
                )
        slack = self.thinnest_m - THINNEST_SHARE * self.outer_m
        if slack < 0:
            raise InvalidDesignError(
                "eccentric_tube needs outer_radius − bore_radius − offset ≥ "
                f"{THINNEST_SHARE:g} outer_radius (the thin wall), but {_mm(self.thinnest_m)} < "
                f"{_mm(THINNEST_SHARE * self.outer_m)}, short by {_mm(-slack)}."
            )
        slack = length_m - THINNEST_SHARE * self.outer_m
        if slack < 0:
            raise InvalidDesignError(
                f"eccentric_tube needs module_length ≥ {THINNEST_SHARE:g} outer_radius (flat elements), but "
                f"{_mm(length_m)} < {_mm(THINNEST_SHARE * self.outer_m)}, short by {_mm(-slack)}."
            )

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


def _mm(length_m: float) -> str:
    return f"{1e3 * length_m:.6g} mm"
