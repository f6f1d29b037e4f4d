"""The second FEM backend: `Ngsolve` makes an `NgsolveSolver` for each module.

Stress, energy and stretch at the mesh's nodes, for pictures: evaluated in each cell, averaged where cells meet.

In a mixed law the volume ratio is the pressure's, Ĵ = 1 + q/K, and F̂ = (Ĵ/J)^⅓ F is what the material sees, so that
nearly incompressible solids show the pressure that was solved for and not the noise of K (J − 1).
"""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse

from pliant.errors import UserError
from pliant.interfaces.by_region import material_by_cell
from pliant.interfaces.fem import FEMBackend
from pliant.interfaces.material import Material
from pliant.meshing.hexahedra import cell_volumes, shape_slopes
from pliant.records.design import Array
from pliant.records.fem import FemState, IntArray, ModuleFields, ModuleProblem
from pliant_plugins.fem.config import NgsolveConfig
from pliant_plugins.fem.constraints import Constraints
from pliant_plugins.fem.iteration import SingularMatrixError, Tolerance
from pliant_plugins.fem.newton import Control, Newton, PathPoint, Reduced
from pliant_plugins.fem.ngsolve.forms import AXES, STRAIN, Forms, build_forms
from pliant_plugins.fem.ngsolve.library import SparseMatrixd, ngs
from pliant_plugins.fem.ngsolve.mesh import LATTICE, cell_values, curved_mesh, eliminate, nodal_table
from pliant_plugins.fem.rod_solver import RodSolver, field_values

# NGSolve's assembly lets other Python threads run and has one heap for all of them.
ONE_AT_A_TIME = threading.RLock()
ACCURATE = 1e-6  # relative residual of a linear solution; refined once where it is larger


class Value(NamedTuple):
    """A functional at x, with its gradient over the unknowns that are left and the numbers."""

    value: float
    gradient: Array


@dataclass(frozen=True, eq=False)
class _Scatter:
    """Entries of a form's matrix, lower triangle: which to take, where they go, with what weight."""

    taken: IntArray
    slot: IntArray
    weight: Array


class NgsolveSystem:
    """Functionals of one problem over the unknowns that its constraints leave."""

    def __init__(self, forms: Forms, elimination: Constraints, threads: int) -> None:
        self.forms, self.elimination, self.threads = forms, elimination, threads
        self.count = len(forms.globals_)
        self.size = forms.space.ndof
        self._vector = ngs.GridFunction(forms.space).vec
        self._image = self._vector.CreateVector()
        self._pattern()

    @property
    def fields(self) -> int:
        """Unknowns that are no numbers, fixed ones too."""
        return self.size - self.count

    def step(self, inner: Array, globals_: Array) -> Array:
        """Return the change of x."""
        return np.concatenate([self.elimination.spread @ inner, globals_])

    def work(self, point: PathPoint[Value], step: tuple[Array, Array], control: Control) -> float:
        """Return Σ |r_i Δ_i| over the free unknowns."""
        residual, k = point.residual, self.count
        efforts, free = residual[-k:] + control.effort, ~control.held
        inner, change = np.abs(residual[:-k] * step[0]).sum(), np.abs(efforts[free] * step[1][free]).sum()
        return float(inner + change)

    def evaluate(self, x: Array, actuation: float) -> PathPoint[Value] | None:
        """Evaluate values and gradients at x; `None` if they do not exist (a cell is inverted)."""
        if not np.all(np.isfinite(x)):
            return None
        with self._at(x):
            energy = self.forms.stored.Energy(self._vector)
            travel = self.forms.worked.Energy(self._vector)
            gradients = [self._applied(form) for form in (self.forms.stored, self.forms.worked)]
        if not (np.isfinite(energy) and all(np.all(np.isfinite(g)) for g in gradients)):
            return None
        return PathPoint(
            x, actuation, Value(float(energy), gradients[0]), (Value(float(travel), gradients[1]),)
        )

    def reduce(self, point: PathPoint[Value]) -> Reduced:
        """Assemble, factorise and condense at a point. Raises `SingularMatrixError`."""
        with self._at(point.x):
            self.forms.stored.AssembleLinearization(self._vector)
            self.forms.worked.AssembleLinearization(self._vector)
        parts = [self._entries(form.mat, s) for form, s in zip(self._both, self._scatters, strict=True)]
        values, borders, corner = (a - point.actuation * b for a, b in zip(*parts, strict=True))
        n = len(self.elimination.first)
        residual, work = point.residual, point.travels[0].gradient
        solved = self._solve(values, np.column_stack([residual[:n], borders, work[:n]]))
        tail = np.column_stack([residual[n:], corner, work[n:]])
        full = tail - borders.T @ solved
        return Reduced.from_condensed(solved, full, self.count)

    def again(self, point: PathPoint[Value]) -> tuple[Array, Array]:
        """Return (r_v, K⁻¹ r_v) with the matrix that was factorised last."""
        right = point.residual[: len(self.elimination.first)]
        return right, self._backward(right[:, None])[:, 0]

    @property
    def _both(self) -> tuple[Any, Any]:
        return self.forms.stored, self.forms.worked

    @contextlib.contextmanager
    def _at(self, x: Array) -> Iterator[None]:
        """Set NGSolve's vector to x; its tasks run on the allowed number of threads."""
        with ONE_AT_A_TIME:
            self._vector.FV().NumPy()[:] = x
            if self.threads == 1:
                yield
                return
            ngs.SetNumThreads(self.threads)
            with ngs.TaskManager():
                yield

    def _applied(self, form: Any) -> Array:
        form.Apply(self._vector, self._image)
        full = self._image.FV().NumPy()
        n = self.fields
        return np.concatenate([self.elimination.spread.T @ full[:n], full[n:]])

    def _pattern(self) -> None:
        """Compute the slots of both forms' entries in one lower triangle over y."""
        with self._at(np.zeros(self.size)):
            for form in self._both:
                form.AssembleLinearization(self._vector)
        master, sign, n = self.elimination.number, self.elimination.sign, len(self.elimination.first)
        keys, parts = [], []
        for form in self._both:
            row, column = _places(form.mat)
            taken = np.flatnonzero((row < self.fields) & (column <= row))
            i, j = row[taken], column[taken]
            weight = sign[i] * sign[j]
            kept = (master[i] >= 0) & (master[j] >= 0)
            taken, i, j, weight = taken[kept], i[kept], j[kept], weight[kept]
            a, b = master[i], master[j]
            # two unknowns of one group: both triangles fall on the diagonal
            weight = np.where((a == b) & (i != j), 2 * weight, weight)
            keys.append(np.maximum(a, b) * n + np.minimum(a, b))
            parts.append((taken, weight))
        self._keys = np.unique(np.concatenate([*keys, np.arange(n) * (n + 1)]))
        self._scatters = [
            _Scatter(taken, np.searchsorted(self._keys, key), weight)
            for key, (taken, weight) in zip(keys, parts, strict=True)
        ]
        self._rows, self._columns = self._keys // n, self._keys % n
        self._starts = np.searchsorted(self._rows, np.arange(n + 1))
        self._matrix: Any = None
        self._inverse: Any = None

    def _entries(self, matrix: Any, scatter: _Scatter) -> tuple[Array, Array, Array]:
        """Lower triangle's values, border (n, k) and corner (k, k) of a form's matrix."""
        full = _csr(matrix)
        lower: Array = np.bincount(
            scatter.slot, scatter.weight * full.data[scatter.taken], len(self._keys)
        ).astype(float)
        edge = full[self.fields :].toarray().T
        return lower, self.elimination.spread.T @ edge[: self.fields], edge[self.fields :]

    def _solve(self, values: Array, right: Array) -> Array:
        """Solve K⁻¹ B by NGSolve's sparse LDLᵀ, refined if needed. Raises `SingularMatrixError`."""
        n = len(self.elimination.first)
        try:
            if self._inverse is None:
                rows, columns = self._rows.astype(np.int32), self._columns.astype(np.int32)
                self._matrix = SparseMatrixd.CreateFromCOO(rows, columns, values, n, n)
                self._inverse = self._matrix.Inverse(inverse="sparsecholesky")
            else:
                self._matrix.AsVector().FV().NumPy()[:] = values
                self._inverse.Update()
        except Exception as error:  # NGSolve's own exceptions have no common name
            self._inverse = None
            raise SingularMatrixError(str(error)) from error
        lower = sparse.csr_matrix((values, self._columns, self._starts), shape=(n, n))
        diagonal = lower.diagonal()[:, None]
        solved = self._backward(right)
        enough = ACCURATE * np.abs(right).max(axis=0)
        for _ in range(2):
            left = right - (lower @ solved + lower.T @ solved - diagonal * solved)
            if np.all(np.abs(left).max(axis=0) <= enough):
                return solved
            solved += self._backward(left)
        raise SingularMatrixError("the tangent stiffness is singular")

    def _backward(self, right: Array) -> Array:
        given, found = self._matrix.CreateColVector(), self._matrix.CreateColVector()
        solved = np.empty_like(right)
        for k in range(right.shape[1]):
            given.FV().NumPy()[:] = right[:, k]
            found.data = self._inverse * given
            solved[:, k] = found.FV().NumPy()
        return solved


def _csr(matrix: Any) -> sparse.csr_matrix:
    """Return NGSolve's matrix as SciPy's."""
    values, columns, starts = (np.array(part) for part in matrix.CSR())
    return sparse.csr_matrix((values, columns, starts.astype(np.int64)), shape=(matrix.height, matrix.width))


def _places(matrix: Any) -> tuple[IntArray, IntArray]:
    """Return rows and columns of a matrix's entries, in the order of its values."""
    found = _csr(matrix)
    return np.repeat(np.arange(matrix.height), np.diff(found.indptr)), found.indices.astype(np.int64)


def deformation_gradients(
    problem: ModuleProblem, scalar: Any, displacement: Array, turn: Array, strain: float
) -> Array:
    """Return F (m, 27, 3, 3) at the cells' nodes, less the section's rotation.

    Args:
        scalar: the H1 space of one displacement component.
        displacement: (unknowns, 3) coefficients of v in m.
        turn: Θ (3,).
        strain: e.
    """
    mesh = problem.mesh
    slopes = np.einsum("mai,qaj->mqij", mesh.nodes_m[mesh.cells], shape_slopes(LATTICE))
    inverse = np.linalg.inv(slopes)
    S = np.empty((len(mesh.cells), 27, 3, 3))
    rho = np.empty((len(mesh.cells), 27, 2))
    for cell in range(len(mesh.cells)):
        element = ngs.ElementId(ngs.VOL, cell)
        shape, local = scalar.GetFE(element), displacement[list(scalar.GetDofNrs(element))]
        for place, point in enumerate(LATTICE):
            by_reference = np.array(shape.CalcDShape(*point))
            S[cell, place] = local.T @ by_reference @ inverse[cell, place]
            rho[cell, place] = (np.array(shape.CalcShape(*point)) @ local)[1:]
    S += np.eye(3)
    S[..., 0, 0] += strain
    rho += mesh.nodes_m[mesh.cells][..., 1:] - np.array([0.0, problem.reference_z_m])
    k = turn / ((1 + strain) * problem.span_m)
    across = np.cross(k, np.concatenate([np.zeros((*rho.shape[:2], 1)), rho], axis=-1))
    return np.asarray(S + across[..., :, None] * S[..., :1, :])


def nodal_fields(material: Material, F: Array, pressure: Array, cells: IntArray) -> dict[str, Array]:
    """Return fields (n,) of `ModuleFields` from F (m, 27, 3, 3) and q (m, 27) in Pa, NaN for a law without q."""
    J = np.linalg.det(F)
    ratio = np.where(np.isnan(pressure), J, 1 + pressure / material.bulk_modulus_pa)
    seen = (ratio / J)[..., None, None] ** (1 / 3) * F
    law = material.evaluate(seen)
    stress = law.stress @ np.swapaxes(seen, -1, -2) / ratio[..., None, None]
    values = field_values(seen, stress, law.energy, ratio)
    count = np.bincount(cells.ravel())
    return {name: np.bincount(cells.ravel(), value.ravel()) / count for name, value in values.items()}


class NgsolveSolver(RodSolver):
    """States of one module in the rod frame.

    A state's `solution` is (v/span, q/μ, numbers): NGSolve's hierarchical unknowns of displacement and pressure, then
    the components of Θ that are axes, and e.
    """

    remembered = 6

    def __init__(self, config: NgsolveConfig, problem: ModuleProblem, material: Material) -> None:
        self.material = material_by_cell(problem.mesh, material)
        mesh = curved_mesh(problem.mesh)
        forms = build_forms(mesh, problem, material, config.order)
        scalar = ngs.H1(mesh, order=config.order)
        self.system = NgsolveSystem(
            forms,
            eliminate(problem, scalar, forms.space.ndof - len(forms.globals_)),
            config.threads,
        )
        volume = float(cell_volumes(problem.mesh.nodes_m, problem.mesh.cells).sum())
        unit = material.shear_modulus_pa * volume
        tolerance = Tolerance(
            unit, config.tolerance, config.max_iterations, config.max_halvings, 0.1, 1 / 16, 1.0
        )
        self._table = nodal_table(scalar, problem.mesh)
        self._scalar = scalar
        prismatic = problem.joint == "prismatic"
        names = (STRAIN,) if prismatic else problem.axes
        scale = problem.deformation_scale * (problem.span_m if prismatic else 1.0)
        places = tuple(forms.globals_.index(name) for name in names)
        super().__init__(problem, Newton(self.system, tolerance), places, (scale,) * len(names))

    def fields(self, state: FemState) -> ModuleFields:
        """Return displacement, stress, energy, volume ratio and stretch at the mesh's nodes."""
        mesh, x = self.problem.mesh, state.solution
        turn, strain = self._frame(x)
        shift = self.problem.span_m * x[: 3 * self._scalar.ndof].reshape(3, -1).T
        F = deformation_gradients(self.problem, self._scalar, shift, turn, strain)
        pressure, first = np.full(mesh.cells.shape, np.nan), 3 * self._scalar.ndof
        for solid in self.system.forms.pressures:
            unknowns = x[first : first + solid.space.ndof]
            pressure[solid.cells] = solid.scale_pa * cell_values(solid.space, unknowns, solid.cells)
            first += solid.space.ndof
        return ModuleFields(
            points_m=mesh.nodes_m,
            displacement_m=self.deformed_nodes(state) - mesh.nodes_m,
            cells=mesh.cells,
            point_data=nodal_fields(self.material, F, pressure, mesh.cells),
        )

    def cavity_volume(self, state: FemState) -> float:
        """Return volume (m³) of the whole module's cavity, of a problem under pressure."""
        return state.travel + self.problem.energy_scale * self._travel_at_rest

    def _undeformed(self) -> Array:
        return np.zeros(self.system.size)

    def _frame(self, x: Array) -> tuple[Array, float]:
        values = dict(zip(self.system.forms.globals_, x[self.system.fields :].tolist(), strict=True))
        return np.array([values.get(axis, 0.0) for axis in AXES]), values.get(STRAIN, 0.0)

    def _section(self, x: Array) -> Array:
        nodes = self.problem.mesh.nodes_m
        shift = self.problem.span_m * x[: 3 * self._scalar.ndof].reshape(3, -1).T
        section: Array = nodes + self._table @ shift
        section[:, 0] += self._frame(x)[1] * nodes[:, 0]
        return section


class Ngsolve(FEMBackend):
    """NGSolve: Taylor–Hood hexahedra of order 2 or 3, energies differentiated symbolically, sparse LDLᵀ."""

    config: NgsolveConfig
    knows = frozenset({"regions", "ribbons", "tendon", "links", "ties"})

    def solver(self, problem: ModuleProblem, material: Material) -> NgsolveSolver:
        """Return the solver. Raises `UserError` for a problem or requirement that this backend does not support."""
        self.check(problem, material)
        if problem.frame != "rod":
            raise UserError(f"fem 'ngsolve' solves frame 'rod' only, not '{problem.frame}'.")
        with ONE_AT_A_TIME:
            return NgsolveSolver(self.config, problem, material)
