"""The PneuNet on cells that shrink toward its sharp inner edges, where uniform ones of any code converge slowly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from pliant.records.design import Array
from pliant.records.fem import ModuleProblem
from pliant_plugins.families.pneunet.family import Pneunet, mesh_on

SHARP = ((1, 2), (1, 2), (2, 3, 4, 5))  # places of the lines of x, y and z that are inner edges of the solid
MOST = 60  # cells between two lines


def graded_problem(family: Pneunet, smallest_m: float, largest_m: float = np.inf) -> ModuleProblem:
    """Return the problem with cells of about `smallest_m` at inner edges that double in size up to a limit."""
    g = family.geometry
    ends = zip((g.x_lines, g.y_lines, g.z_lines), SHARP, strict=True)
    mesh = mesh_on(g, [graded_lines(lines, sharp, smallest_m, largest_m) for lines, sharp in ends])
    return replace(family.problem(), mesh=mesh)


def graded_lines(
    ends_m: Sequence[float], sharp: Sequence[int], smallest_m: float, largest_m: float = np.inf
) -> Array:
    """Return grid lines, two intervals a cell, that keep `ends_m` and are dense at `sharp` ones."""
    borders = [ends_m[0]]
    for number, (a, b) in enumerate(pairwise(ends_m)):
        sizes = _sizes(b - a, number in sharp, number + 1 in sharp, smallest_m, largest_m)
        borders += [*(a + np.cumsum(sizes[:-1])), b]
    middles = (np.array(borders[1:]) + borders[:-1]) / 2
    return np.append(np.column_stack([borders[:-1], middles]).ravel(), borders[-1])


def _sizes(length: float, low: bool, high: bool, smallest: float, largest: float) -> Array:
    """Return sizes of the cells between two lines, which are sharp or not; two if neither is."""
    if not (low or high):
        return np.full(2, length / 2)
    reach = length / 2 if low and high else length
    sizes = np.minimum(smallest * 2.0 ** np.arange(MOST), largest)
    # as many as come nearest to the reach, in ratio
    count = 1 + int(np.argmax(np.sqrt(2) * (np.cumsum(sizes) + smallest) >= reach + smallest))
    half = sizes[:count] * (reach / sizes[:count].sum())
    return np.concatenate(([half] if low else []) + ([half[::-1]] if high else []))
