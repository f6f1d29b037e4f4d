"""Where local entries go: the sparse matrix over the unknowns and the maps between them and the dofs."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from pliant.records.design import Array
from pliant.records.fem import IntArray
from pliant_plugins.fem.constraints import Constraints
from pliant_plugins.fem.skfem.kernel import scattered


@dataclass(frozen=True, eq=False)
class Pattern:
    """Upper triangle of the matrix over the unknowns, in compressed rows.

    Attributes:
        free: (n,) one dof of each unknown.
        spread: (size, n) all dofs from the unknowns.
        cellwise: number of volumes ϑ that belong to cells; they and as many pressures are the last unknowns.
    """

    free: IntArray
    spread: sparse.csr_matrix
    indptr: IntArray
    indices: IntArray
    cellwise: int = 0

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return len(self.free)

    @property
    def keys(self) -> IntArray:
        """(nnz,) row · n + column of each entry, ascending."""
        return np.asarray(np.repeat(np.arange(self.size), np.diff(self.indptr)) * self.size + self.indices)

    def with_keys(self, keys: IntArray) -> Pattern:
        """Return a pattern of the same unknowns with other entries."""
        rows = np.bincount(keys // self.size, minlength=self.size)
        indptr = np.concatenate([[0], np.cumsum(rows)])
        return replace(self, indptr=indptr, indices=keys % self.size)

    def expand(self, unknowns: Array) -> Array:
        """Return all dofs from the unknowns (n,) or (n, k)."""
        return np.asarray(self.spread @ unknowns)

    def reduce(self, forces: Array) -> Array:
        """Return the conjugates of the unknowns from those of the dofs (size, k)."""
        return np.asarray(self.spread.T @ forces)


@dataclass(frozen=True, eq=False)
class Scatter:
    """Destinations of local entries.

    Attributes:
        dofs: (m, k).
        chosen: places of the upper triangle's entries in the local matrices (m, k, k), flat.
        slot: place of each in the matrix's values.
        factor: sign of each, twice where two local dofs follow one unknown; None where all are 1.
    """

    dofs: IntArray
    chosen: IntArray
    slot: IntArray
    factor: Array | None

    def values(self, local: Array, count: int) -> Array:
        """Return the matrix's values (count,) from local matrices (m, k, k)."""
        totals, factor = np.zeros(count), np.ones(0) if self.factor is None else self.factor
        scattered(np.ascontiguousarray(local).reshape(-1), self.chosen, self.slot, factor, totals)
        return totals

    def totals(self, local: Array, size: int) -> Array:
        """Return sums over the dofs (size, k) of local columns (m, dofs, k)."""
        flat = self.dofs.ravel()
        return np.column_stack([np.bincount(flat, c.ravel(), size) for c in np.moveaxis(local, -1, 0)])


def distinct(keys: IntArray) -> IntArray:
    """Return sorted unique values; several times faster than NumPy's, which hashes."""
    ordered = np.sort(keys)
    return ordered[np.append(True, ordered[1:] != ordered[:-1])] if len(keys) else ordered


def sparsity(
    constraints: Constraints, groups: list[IntArray], cellwise: int = 0
) -> tuple[Pattern, list[Scatter]]:
    """Return the matrix's pattern for groups of local dofs (m, k), and each group's scatter."""
    number, sign, n = constraints.number, constraints.sign, len(constraints.first)
    entries = []
    for dofs in groups:
        k = dofs.shape[1]
        row, column = np.triu_indices(k)
        i, j = number[dofs[:, row]], number[dofs[:, column]]
        offset = np.arange(len(dofs))[:, None] * k * k + row * k + column
        keep = (i >= 0) & (j >= 0)
        factor = sign[dofs[:, row]] * sign[dofs[:, column]] * np.where((i == j) & (row != column), 2.0, 1.0)
        key = np.minimum(i, j)[keep] * n + np.maximum(i, j)[keep]
        entries.append((dofs, offset[keep], key, factor[keep]))
    keys = distinct(np.concatenate([entry[2] for entry in entries]))
    scatter = [
        Scatter(dofs, chosen, np.searchsorted(keys, key), None if np.all(factor == 1) else factor)
        for dofs, chosen, key, factor in entries
    ]
    none: IntArray = np.zeros(0, np.int64)
    return Pattern(constraints.first, constraints.spread, none, none, cellwise).with_keys(keys), scatter


@dataclass(frozen=True, eq=False)
class Coupling:
    """Values (nnz,) on a pattern over the same unknowns, upper triangle."""

    pattern: Pattern
    values: Array


@dataclass(frozen=True, eq=False)
class Terms:
    """A scalar of x to second order, G globals.

    Attributes:
        value: the scalar.
        gradient: (n + G,) over all dofs, fixed ones too.
        matrix: (nnz,) Hessian over the unknowns, upper triangle on the `Pattern`; of a `slope` nothing.
        border: (n + G, G) Hessian's columns of the globals; of a `slope` no columns.
        coupling: further part of the Hessian over the unknowns, on a separate pattern: contact of walls.
    """

    value: float
    gradient: Array
    matrix: Array
    border: Array
    coupling: Coupling | None = None

    @property
    def slope(self) -> Terms:
        """Value and gradient alone."""
        return Terms(self.value, self.gradient, self.matrix[:0], self.border[:, :0])

    def plus(self, factor: float, other: Terms) -> Terms:
        """Return self + factor · other, of which only self may couple."""
        assert other.coupling is None
        return Terms(
            self.value + factor * other.value,
            self.gradient + factor * other.gradient,
            self.matrix + factor * other.matrix,
            self.border + factor * other.border,
            self.coupling,
        )


class Rows:
    """Rows B_c of a density's variables g: blocks (1 or m, q, rows, nodes), one for each component c.

    Attributes:
        blocks: by component.
        spans: places of each component's variables in g.
    """

    def __init__(self, *blocks: Array) -> None:
        self.blocks = blocks
        ends = np.cumsum([0] + [block.shape[2] for block in blocks])
        self.spans = [slice(a, b) for a, b in itertools.pairwise(ends)]

    def project(self, columns: Array) -> Array:
        """Return Σ_q B_cᵀ columns: (m, local dofs + G, k), component by component, then the plain sums of globals."""
        m, _, _, k = columns.shape
        parts = []
        for block, span in zip(self.blocks, self.spans, strict=True):
            flat = block.reshape(block.shape[0], -1, block.shape[-1])
            parts.append(np.swapaxes(flat, 1, 2) @ columns[:, :, span].reshape(m, -1, k))
        return np.concatenate([*parts, columns[:, :, self.spans[-1].stop :].sum(axis=1)], axis=1)

    def stiffness(self, hessian: Array) -> Array:
        """Return Σ_q Bᵀ H B: (m, n, n) over local dofs, by component; blocks below the diagonal stay zero."""
        m, spans = len(hessian), self.spans
        ends = np.cumsum([0] + [block.shape[-1] for block in self.blocks])
        out = np.zeros((m, ends[-1], ends[-1]))
        for d, right in enumerate(self.blocks):
            for c, left in enumerate(self.blocks[: d + 1]):
                product = (hessian[:, :, spans[c], spans[d]] @ right).reshape(m, -1, right.shape[-1])
                flat = left.reshape(left.shape[0], -1, left.shape[-1])
                block = np.swapaxes(flat, 1, 2) @ product
                out[:, ends[c] : ends[c + 1], ends[d] : ends[d + 1]] = block
        return out
