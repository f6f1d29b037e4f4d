"""Which unknown each displacement follows, and with which sign: fixed, tied and linked ones as one signed map."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from pliant.records.design import Array
from pliant.records.fem import IntArray


@dataclass(frozen=True, eq=False)
class Constraints:
    """All displacements x_i = sign_i · y_number(i), y being the unknowns that are left.

    Attributes:
        number: (size,) place of the unknown, −1 where the displacement is zero.
        sign: (size,) 1 or −1.
        first: (n,) one displacement of each unknown, with the sign 1.
    """

    number: IntArray
    sign: Array
    first: IntArray

    @cached_property
    def spread(self) -> sparse.csr_matrix:
        """(size, n): all displacements from the unknowns; its transpose gives what is conjugate to the unknowns."""
        rows = np.flatnonzero(self.number >= 0)
        entries = (self.sign[rows], (rows, self.number[rows]))
        return sparse.csr_matrix(entries, shape=(len(self.number), len(self.first)))


class Forest:
    """Union–find over displacements, with the sign of each relative to its parent.

    A class of displacements that move alike is zero where one of them is fixed, or where v = −v follows.
    """

    def __init__(self, size: int) -> None:
        self._parent: IntArray = np.arange(size)
        self._sign: Array = np.ones(size)
        self._zero: list[int] = []

    def join(self, first: IntArray, second: IntArray, sign: float) -> None:
        """Impose v(second) = sign · v(first), pairwise."""
        for a, b in zip(first.tolist(), second.tolist(), strict=True):
            (i, of_a), (j, of_b) = self._find(a), self._find(b)
            if i != j:
                self._parent[j], self._sign[j] = i, of_a * of_b * sign
            elif of_a * sign != of_b:
                self._zero.append(a)

    def fix(self, displacements: IntArray) -> None:
        """Impose v = 0."""
        self._zero += displacements.tolist()

    def constraints(self) -> Constraints:
        """Return the map that results from all ties and fixed unknowns."""
        size = len(self._parent)
        for i in np.flatnonzero(self._parent != np.arange(size)).tolist():
            self._find(i)
        fixed = np.zeros(size, bool)
        fixed[self._parent[self._zero]] = True
        free = np.flatnonzero(~fixed & (self._parent == np.arange(size)))
        number = np.full(size, -1)
        number[free] = np.arange(len(free))
        return Constraints(number[self._parent], self._sign, free)

    def _find(self, i: int) -> tuple[int, float]:
        """Return the root of i and i's sign relative to it."""
        path = []
        while self._parent[i] != i:
            path.append(i)
            i = int(self._parent[i])
        sign = 1.0
        for j in reversed(path):
            sign *= float(self._sign[j])
            self._parent[j] = i
            self._sign[j] = sign
        return i, sign
