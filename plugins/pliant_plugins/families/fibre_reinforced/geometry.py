"""The section of a fibre-reinforced tube, and what makes it valid.

Module frame: x along the tube; z = 0 is the middle of the sleeve at the bottom, where the sheet lies. Angles φ about
the tube's axis start at the bottom: y = ρ sin φ, z = axis height − ρ cos φ. The sleeve is the outer part of the wall:
it holds the threads all around and the sheet, |φ| ≤ `sheet_angle`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields

import numpy as np

from pliant.errors import InvalidDesignError

LARGEST_M = 1.0


@dataclass(frozen=True)
class TubeGeometry:
    """Module length, inner radius, whole wall, sleeve (m); half the sheet's opening and the threads' angle (rad)."""

    module_length_m: float
    radius_m: float
    wall_m: float
    sleeve_m: float
    thread_spacing_m: float
    sheet_angle_rad: float
    thread_angle_rad: float

    @property
    def axis_height_m(self) -> float:
        """Height of the tube's axis over the sheet."""
        return self.radius_m + self.wall_m - self.sleeve_m / 2

    def check(self) -> None:
        """Raise `InvalidDesignError`, with the broken inequality and by how much, unless the tube exists."""
        for name, value, than, limit in self._inequalities():
            if not value < limit * (1 - 1e-9):
                raise InvalidDesignError(
                    f"fibre_reinforced needs {name} < {than}, but {_mm(value)} against {_mm(limit)} misses it by "
                    f"{_mm(value - limit)}."
                )
        for name, angle, low, high in (
            ("sheet_angle", self.sheet_angle_rad, 0.0, np.pi),
            ("thread_angle", self.thread_angle_rad, 0.0, np.pi / 2),
        ):
            # threads may run around the tube, a right angle
            if not (low < angle < high or (name == "thread_angle" and angle == high)):
                raise InvalidDesignError(
                    f"fibre_reinforced needs {name} between 0 and {np.degrees(high):g} deg, but it is "
                    f"{np.degrees(angle):.6g} deg, off by {np.degrees(max(low - angle, angle - high)):.6g} deg."
                )

    def _inequalities(self) -> Iterator[tuple[str, float, str, float]]:
        """Name and value of what must be less, name of the limit and limit, in m."""
        lengths = {f.name[:-2]: getattr(self, f.name) for f in fields(self) if f.name.endswith("_m")}
        for name, value in lengths.items():
            if not value > 0:
                raise InvalidDesignError(f"fibre_reinforced needs {name} > 0, but it is {_mm(value)}.")
        yield from (
            (name, value, "1 m (bare numbers are metres)", LARGEST_M) for name, value in lengths.items()
        )
        yield "sleeve (the outer part of the wall)", self.sleeve_m, "wall", self.wall_m


def _mm(length_m: float) -> str:
    return f"{1e3 * length_m:.6g} mm"
