"""One chamber of a fast PneuNet as a solid, and what makes it valid.

Module frame: x along the row with the chamber's middle at x = 0 and the middle of a gap at x = ±l/2; z = 0 is the
mid-plane of the layer. Above the layer a floor, on it the chamber; a channel through walls and gap joins the chambers.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields

from pliant.errors import InvalidDesignError

LARGEST_M = 1.0


@dataclass(frozen=True)
class ChamberGeometry:
    """Module length l, section, walls, gap, channel and layer; all in m."""

    module_length_m: float
    width_m: float
    height_m: float
    wall_m: float
    shell_m: float
    gap_m: float
    floor_m: float
    bridge_m: float
    channel_width_m: float
    channel_height_m: float
    layer_m: float

    @property
    def x_lines(self) -> tuple[float, ...]:
        """From mid-chamber to mid-gap: the wall's inner and outer face between."""
        half = self.module_length_m / 2
        outer = half - self.gap_m / 2
        return 0.0, outer - self.wall_m, outer, half

    @property
    def y_lines(self) -> tuple[float, ...]:
        """From the mirror plane: channel, chamber, outside."""
        return 0.0, self.channel_width_m / 2, self.width_m / 2 - self.shell_m, self.width_m / 2

    @property
    def z_lines(self) -> tuple[float, ...]:
        """Layer, floor, channel, its bridge over the gap, chamber, top."""
        low = self.layer_m / 2
        floor = low + self.floor_m
        channel = floor + self.channel_height_m
        top = low + self.height_m
        return -low, low, floor, channel, channel + self.bridge_m, top - self.shell_m, top

    def check(self) -> None:
        """Raise `InvalidDesignError`, with the broken inequality and by how much, unless the chamber exists."""
        for name, value, than, limit in self._inequalities():
            if not value < limit * (1 - 1e-9):
                raise InvalidDesignError(
                    f"pneunet needs {name} < {than}, but {_mm(value)} against {_mm(limit)} misses it by "
                    f"{_mm(value - limit)}."
                )

    def _inequalities(self) -> Iterator[tuple[str, float, str, float]]:
        """Name and value of what must be less, name of the limit and limit, in m."""
        lengths = {f.name[:-2]: getattr(self, f.name) for f in fields(self)}
        for name, value in lengths.items():
            if not value > 0:
                raise InvalidDesignError(f"pneunet needs {name} > 0, but it is {_mm(value)}.")
        yield from (
            (name, value, "1 m (bare numbers are metres)", LARGEST_M) for name, value in lengths.items()
        )
        along = "2 wall + gap (the chamber needs room)"
        yield along, 2 * self.wall_m + self.gap_m, "module_length", self.module_length_m
        across = "2 shell + channel_width (the channel is narrower than the chamber)"
        yield across, 2 * self.shell_m + self.channel_width_m, "width", self.width_m
        upward = "floor + channel_height + bridge + shell (the chamber is higher than the channel's bridge)"
        stacked = self.floor_m + self.channel_height_m + self.bridge_m + self.shell_m
        yield upward, stacked, "height", self.height_m


def _mm(length_m: float) -> str:
    return f"{1e3 * length_m:.6g} mm"
