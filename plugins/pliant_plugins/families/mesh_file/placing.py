"""From the file's frame and unit to the module frame, and what must be true of it there.

Module x runs from `base` to `tip`, z is `up`, y = z × x. The base's plane becomes x = 0, a symmetry plane y = 0 with
the solid at y ≥ 0, the reference line y = z = 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pliant.errors import InvalidDesignError
from pliant.meshing.cells import area_vector, cell_volumes
from pliant.records.design import Array
from pliant.records.fem import IntArray

UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "in": 25.4e-3}
LARGEST_M, SMALLEST_M = 1.0, 1e-4  # length of a solved piece that is taken for meant
# Of the solid's mean section: an end section below the first is refused, below the second remarked upon.
NO_SECTION, SMALL_SECTION = 0.05, 0.25
FLAT = 1e-4  # of the piece's length: tolerance of a plane's nodes
DIRECTIONS = {
    sign + name: factor * np.eye(3)[k]
    for k, name in enumerate("xyz")
    for sign, factor in (("", 1.0), ("-", -1.0))
}


def rotation(along: str, up: str) -> Array:
    """Return the module's axes in the file's frame as rows. Raises `InvalidDesignError` unless perpendicular."""
    x, z = DIRECTIONS[along], DIRECTIONS[up]
    if abs(x @ z) > 0.5:
        raise InvalidDesignError(
            f"family: 'along: {along}' and 'up: {up}' lie on one line; the chain's direction and the direction away "
            "from which pressure bends it are perpendicular."
        )
    return np.stack([x, np.cross(z, x), z])


@dataclass(frozen=True)
class Ends:
    """Positions of the end sections along module x, in m from the file's origin."""

    base_m: float
    tip_m: float

    @property
    def span_m(self) -> float:
        """L, from base to tip."""
        return self.tip_m - self.base_m


def require_unit(nodes_m: Array, unit: str, name: str) -> None:
    """Raise `InvalidDesignError` for a body of an implausible size, and name the unit that may be right."""
    size = float(np.ptp(nodes_m, axis=0).max())
    fits = [
        other for other, factor in UNITS.items() if SMALLEST_M <= size / UNITS[unit] * factor <= LARGEST_M
    ]
    better = "mm" if "mm" in fits else fits[0] if fits else None
    if not SMALLEST_M <= size <= LARGEST_M:
        meant = f"were {better} meant? Write 'unit: {better}'" if better else "give its unit as 'unit: mm'"
        raise InvalidDesignError(
            f"the body in '{name}' is {size:.4g} m long with 'unit: {unit}', a module is between {SMALLEST_M:g} and "
            f"{LARGEST_M:g} m; {meant}."
        )


def end_planes(nodes_m: Array, base: IntArray, tip: IntArray, names: tuple[str, str]) -> Ends:
    """Return the planes of two surfaces (faces of nodes already turned to the module's axes).

    Raises `InvalidDesignError` for surfaces that are no planes across x, or the wrong way round.
    """
    length = float(np.ptp(nodes_m[:, 0]))
    places = [_plane(nodes_m, faces, name, length) for faces, name in zip((base, tip), names, strict=True)]
    if places[0] > places[1]:
        raise InvalidDesignError(
            f"the tip '{names[1]}' lies before the base '{names[0]}' along module x; turn the sign of 'along', or "
            "exchange the two names."
        )
    low, high = float(nodes_m[:, 0].min()), float(nodes_m[:, 0].max())
    for place, reach, name in ((places[0], low, names[0]), (places[1], high, names[1])):
        if abs(place - reach) > FLAT * length:
            raise InvalidDesignError(
                f"the solid reaches {1e3 * abs(place - reach):.4g} mm beyond the plane of '{name}'; cut the module "
                "between two planes across the chain."
            )
    return Ends(*places)


def _plane(nodes_m: Array, faces: IntArray, name: str, length: float) -> float:
    """Return x of a plane surface across x."""
    x = nodes_m[np.unique(faces), 0]
    if np.ptp(x) > FLAT * length:
        normal = area_vector(nodes_m, faces)
        axis = "xyz"[int(np.abs(normal).argmax())]
        hint = (
            "" if axis == "x" else f"; it looks along module {axis}: set 'along' and 'up' to the file's axes"
        )
        raise InvalidDesignError(
            f"surface '{name}' is no plane across the chain: its nodes lie between x = {1e3 * x.min():.5g} and "
            f"{1e3 * x.max():.5g} mm{hint}."
        )
    return float(x.mean())


def require_whole_section(
    nodes_m: Array,
    faces: IntArray,
    chosen: NDArray[np.bool_],
    place: float,
    axis: int,
    tolerance: float,
    name: str,
) -> None:
    """Raise `InvalidDesignError` where outer faces on the plane are not in the surface."""
    on_plane = np.all(np.abs(nodes_m[faces, axis] - place) <= tolerance, axis=1)
    missing = int((on_plane & ~chosen).sum())
    if missing:
        raise InvalidDesignError(
            f"surface '{name}' misses {missing} of the {int(on_plane.sum())} faces of its plane; the whole section "
            "belongs to it."
        )


def require_sections(nodes_m: Array, cells: IntArray, ends: Sequence[tuple[str, IntArray]]) -> list[str]:
    """Return sentences about end sections that are small compared with the body: they connect poorly to a neighbour.

    The measure is the area of the section over volume / length of the solid.

    Args:
        nodes_m: (n, 3) in the module frame.
        cells: of the solid.
        ends: names and faces of the two end surfaces.

    Raises:
        InvalidDesignError: an end section below `NO_SECTION` of the mean one.
    """
    mean = float(cell_volumes(nodes_m, cells).sum() / np.ptp(nodes_m[:, 0]))
    said = []
    for name, faces in ends:
        area = float(np.abs(area_vector(nodes_m, faces)[0]))
        words = (
            f"surface '{name}' is {1e6 * area:.3g} mm² large, {area / mean:.1%} of the solid's mean section "
            f"({1e6 * mean:.3g} mm²)"
        )
        if area < NO_SECTION * mean:
            raise InvalidDesignError(
                f"{words}: the next module would hang on that; cut the module where its whole section ends."
            )
        if area < SMALL_SECTION * mean:
            said.append(f"{words}: the stiffness of a joint is mostly that of this neck.")
    return said


def mirror_side(nodes_m: Array, faces: IntArray, length: float, name: str) -> tuple[float, bool]:
    """Return y of the mirror plane and whether the solid is below it.

    Raises `InvalidDesignError` for a surface that is no plane y = const, or that has the solid on both sides.
    """
    y = nodes_m[np.unique(faces), 1]
    if np.ptp(y) > FLAT * length:
        raise InvalidDesignError(
            f"symmetry surface '{name}' is no plane that holds the chain and 'up': its nodes lie between y = "
            f"{1e3 * y.min():.5g} and {1e3 * y.max():.5g} mm."
        )
    place = float(y.mean())
    low, high = float(nodes_m[:, 1].min()) - place, float(nodes_m[:, 1].max()) - place
    if low < -FLAT * length and high > FLAT * length:
        raise InvalidDesignError(
            f"the solid lies on both sides of the symmetry plane '{name}'; cut it there."
        )
    return place, high < -low
