"""From densities at quadrature points to the system's vectors and matrices, batched over cells.

The unknowns are x = (v, θ, e): three displacements per node, node by node, then the two globals. A density's
variables g are linear in the local displacements, one block of rows B_c per component c, so that

    r_c = Σ_q B_cᵀ ∂w/∂g_c,    K_cd = Σ_q B_cᵀ ∂²w/∂g_c∂g_d B_d

are products of small matrices. Global columns (θ, e) are kept apart from the sparse matrix over v.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pliant.interfaces.material import Material
from pliant.records.design import Array
from pliant.records.fem import IntArray, ModuleProblem
from pliant_plugins.fem.skfem.basis import cell_data, face_data
from pliant_plugins.fem.skfem.cavity import volume
from pliant_plugins.fem.skfem.kinematics import BendFrame, Pointwise, SolidDensity, strain_energy

Rows = tuple[Array, ...]


@dataclass(frozen=True, eq=False)
class Terms:
    """A scalar of x to second order.

    Attributes:
        value: the scalar.
        gradient: (n + 2,) over all dofs, fixed ones too.
        matrix: (nnz,) Hessian over the free displacements, upper triangle on the `Pattern`.
        border: (n + 2, 2) Hessian's columns of θ and e.
    """

    value: float
    gradient: Array
    matrix: Array
    border: Array

    def minus(self, factor: float, other: Terms) -> Terms:
        """self − factor · other."""
        return Terms(
            self.value - factor * other.value,
            self.gradient - factor * other.gradient,
            self.matrix - factor * other.matrix,
            self.border - factor * other.border,
        )


@dataclass(frozen=True, eq=False)
class Pattern:
    """Upper triangle of the matrix over free displacements, in compressed rows."""

    free: IntArray
    indptr: IntArray
    indices: IntArray

    @property
    def size(self) -> int:
        return len(self.free)


@dataclass(frozen=True, eq=False)
class Scatter:
    """Where local entries go: dofs (m, k); for the chosen entries of (m, k, k), their slot in the matrix."""

    dofs: IntArray
    chosen: IntArray
    slot: IntArray


class Assembler:
    """Assembles the strain energy U(x) and the cavity volume V(x) of one problem."""

    def __init__(
        self, problem: ModuleProblem, material: Material, dilatation: Literal["cell", "point"] = "cell"
    ) -> None:
        mesh = problem.mesh
        self.problem, self.material = problem, material
        self.frame = BendFrame(problem.span_m, problem.reference_z_m)
        self.cells, self.faces = cell_data(mesh, dilatation), face_data(mesh.cavity)
        self.size = mesh.nodes_m.size
        self.volume_m3 = float(self.cells.weight.sum())
        fixed = np.zeros(self.size, bool)
        for name, components in problem.fixed.items():
            for component in components:
                fixed[3 * mesh.node_sets[name] + component] = True
        self.pattern, (self._cell_scatter, self._face_scatter) = _pattern(
            np.flatnonzero(~fixed), self.size, [self.cells.nodes, self.faces.nodes]
        )
        self._cell_rows, self._face_rows = self._operators()
        # slopes of the reference position along the faces' coordinates, which the axial strain e stretches
        self._face_X = np.einsum("fa,qja->fqj", mesh.nodes_m[self.faces.nodes, 0], self.faces.slope)

    def _operators(self) -> tuple[Rows, Rows]:
        """Rows B_c (m or 1, q, rows, nodes) of the local variables, for c = x, y, z."""
        cells, faces = self.cells, self.faces
        value = np.broadcast_to(cells.value[None, :, None], (*cells.weight.shape, 1, 27))
        cell_rows = (cells.gradient, cells.gradient, np.concatenate([cells.gradient, value], axis=2))
        slope, value = faces.slope[None], faces.value[None, :, None]
        return cell_rows, (slope, value, np.concatenate([value, slope], axis=2))

    def positions(self, x: Array) -> Array:
        """X + v of all nodes, (nodes, 3)."""
        return self.problem.mesh.nodes_m + x[: self.size].reshape(-1, 3)

    def strain_energy(self, x: Array) -> Terms | None:
        """U (J) of the piece and its derivatives; `None` where a cell is inverted."""
        local = self.positions(x)[self.cells.nodes]
        m, q = self.cells.weight.shape
        S = self.cells.gradient.reshape(m, 3 * q, 27) @ local
        S = S.reshape(m, q, 3, 3).transpose(0, 1, 3, 2)
        zeta = local[:, :, 2] @ self.cells.value.T - self.frame.reference_z_m
        density = strain_energy(self.frame, self.material, self.cells, S, zeta, x[-2], x[-1])
        if density is None:
            return None
        return self._gather(density, self.cells.weight, self._cell_rows, self._cell_scatter)

    def cavity(self, x: Array) -> Terms:
        """V (m³) of the piece's cavity and its derivatives."""
        local = self.positions(x)[self.faces.nodes]
        slope = np.einsum("fai,qja->ifqj", local, self.faces.slope)
        y, z = (local[:, :, i] @ self.faces.value.T for i in (1, 2))
        zeta = z - self.frame.reference_z_m
        density = volume(self.frame, slope[0], y, zeta, slope[2], self._face_X, x[-2], x[-1])
        weight = np.broadcast_to(self.faces.weight, y.shape)
        return self._gather(density, weight, self._face_rows, self._face_scatter)

    def _gather(self, density: Pointwise, weight: Array, rows: Rows, scatter: Scatter) -> Terms:
        """Sum a density over the quadrature points and send it to the dofs."""
        gradient = weight[..., None] * density.gradient
        hessian = weight[..., None, None] * density.hessian
        # right-hand sides: the gradient, and the Hessian's columns of θ and e
        columns = np.concatenate([gradient[..., None], hessian[..., -2:]], axis=-1)
        local = _project(rows, columns)
        stiffness = _stiffness(rows, hessian)
        if isinstance(density, SolidDensity) and self.cells.modes is not None:
            a, c = _through_dilatation(density, weight, self.cells.modes, rows)
            stiffness += a[:, :-2] @ np.swapaxes(c[:, :-2], 1, 2) + c[:, :-2] @ np.swapaxes(a[:, :-2], 1, 2)
            local[..., 1:] += a @ np.swapaxes(c[:, -2:], 1, 2) + c @ np.swapaxes(a[:, -2:], 1, 2)
        return self._scatter(float(np.sum(weight * density.value)), local, stiffness, scatter)

    def _scatter(self, value: float, local: Array, stiffness: Array, scatter: Scatter) -> Terms:
        """Local columns (m, k + 2, 3) and matrices (m, k, k) to the dofs; the last two rows are θ and e."""
        totals = np.empty((self.size + 2, 3))
        for i in range(3):
            totals[:-2, i] = np.bincount(scatter.dofs.ravel(), local[:, :-2, i].ravel(), self.size)
        totals[-2:] = local[:, -2:].sum(axis=0)
        chosen = np.asarray(stiffness.ravel()[scatter.chosen], float)
        matrix = np.bincount(scatter.slot, chosen, minlength=len(self.pattern.indices)).astype(
            float, copy=False
        )
        return Terms(value, totals[:, 0], matrix, totals[:, 1:])


def _through_dilatation(
    density: SolidDensity, weight: Array, modes: Array, rows: Rows
) -> tuple[Array, Array]:
    """Factors a, c (m, k + 2, 4) of the Hessian's part a cᵀ + c aᵀ that a cell's dilatation Ĵ carries.

    a_k = ∂(∫ φ_k J)/∂x, b_k = ∫ φ_k ∂²W/∂x∂Ĵ, D_kl = ∫ φ_k φ_l ∂²W/∂Ĵ², and c = b + ½ a D.
    """
    weighted = weight[..., None] * modes
    a = _project(rows, density.volume[..., None] * weighted[..., None, :])
    b = _project(rows, density.coupling[..., None] * weighted[..., None, :])
    D = np.swapaxes(weighted * density.curvature[..., None], 1, 2) @ modes
    return a, b + 0.5 * (a @ D)


def _spans(rows: Rows) -> list[slice]:
    """Places of each component's variables in g."""
    ends = np.cumsum([0] + [block.shape[2] for block in rows])
    return [slice(a, b) for a, b in itertools.pairwise(ends)]


def _project(rows: Rows, columns: Array) -> Array:
    """Σ_q B_cᵀ columns: (m, 3 · nodes + 2, k), component by component, then the plain sums for θ and e."""
    m, _, _, k = columns.shape
    parts = []
    for block, span in zip(rows, _spans(rows), strict=True):
        flat = block.reshape(block.shape[0], -1, block.shape[-1])
        parts.append(np.swapaxes(flat, 1, 2) @ columns[:, :, span].reshape(m, -1, k))
    return np.concatenate([*parts, columns[:, :, -2:].sum(axis=1)], axis=1)


def _stiffness(rows: Rows, hessian: Array) -> Array:
    """Σ_q Bᵀ H B: (m, 3 · nodes, 3 · nodes), component by component; blocks below the diagonal stay zero."""
    m, nodes, spans = len(hessian), rows[0].shape[-1], _spans(rows)
    out = np.zeros((m, 3 * nodes, 3 * nodes))
    for d, right in enumerate(rows):
        for c, left in enumerate(rows[: d + 1]):
            product = (hessian[:, :, spans[c], spans[d]] @ right).reshape(m, -1, nodes)
            flat = left.reshape(left.shape[0], -1, nodes)
            block = np.swapaxes(flat, 1, 2) @ product
            out[:, c * nodes : (c + 1) * nodes, d * nodes : (d + 1) * nodes] = block
    return out


def _pattern(free: IntArray, size: int, groups: list[IntArray]) -> tuple[Pattern, list[Scatter]]:
    """Sparsity of the matrix over the free dofs of all groups of local nodes, and each group's scatter."""
    number = np.full(size, -1)
    number[free] = np.arange(len(free))
    entries = []
    for nodes in groups:
        dofs = np.concatenate([3 * nodes + c for c in range(3)], axis=1)
        k = dofs.shape[1]
        row, column = np.triu_indices(k)
        i, j = number[dofs[:, row]], number[dofs[:, column]]
        offset = np.arange(len(nodes))[:, None] * k * k + row * k + column
        keep = (i >= 0) & (j >= 0)
        key = np.minimum(i, j)[keep] * len(free) + np.maximum(i, j)[keep]
        entries.append((dofs, offset[keep], key))
    keys = np.unique(np.concatenate([key for *_, key in entries]))
    counts = np.bincount(keys // len(free), minlength=len(free))
    indptr = np.concatenate([[0], np.cumsum(counts)])
    scatter = [Scatter(dofs, chosen, np.searchsorted(keys, key)) for dofs, chosen, key in entries]
    return Pattern(free, indptr, keys % len(free)), scatter
