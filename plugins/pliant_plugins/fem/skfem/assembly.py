"""From densities at quadrature points to the system's vectors and matrices, batched over cells.

The unknowns are x: displacements v, volumes and pressures of mixed cells, globals (`unknowns`). A density's variables
g are linear in the local ones, one block of rows B_c per component c, so that

    r_c = Σ_q B_cᵀ ∂w/∂g_c,    K_cd = Σ_q B_cᵀ ∂²w/∂g_c∂g_d B_d

are products of small matrices. The globals' columns are kept apart from the sparse matrix over v.
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

from pliant.interfaces.by_region import material_by_cell
from pliant.interfaces.material import Material
from pliant.records.actuation import kind_of
from pliant.records.design import Array
from pliant.records.fem import IntArray, ModuleProblem
from pliant_plugins.fem.config import Dilatation
from pliant_plugins.fem.skfem.basis import cell_data, face_data
from pliant_plugins.fem.skfem.dilatation import mixed, pointwise
from pliant_plugins.fem.skfem.fibres import with_fibres
from pliant_plugins.fem.skfem.kernel import projected
from pliant_plugins.fem.skfem.kinematics import Pointwise, RodMotion, Variables, motion
from pliant_plugins.fem.skfem.pattern import Coupling, Scatter, Terms, sparsity
from pliant_plugins.fem.skfem.potentials import drawn, ribbon_energy, volume
from pliant_plugins.fem.skfem.stops import stop_energy
from pliant_plugins.fem.skfem.unknowns import Globals, constraints
from pliant_plugins.fem.skfem.walls import Contacts

Rows = tuple[Array, ...]


class Assembler:
    """Assembles the elastic energy U(x) of one problem and what its actuation works on.

    Attributes:
        size: number of dofs, the globals left out.
        displacements, volumes, pressures: places of v, ϑ and q in x; U is stationary but not least in q.
        contacts: what the skin may meet; None where contact is not solved.
    """

    def __init__(
        self,
        problem: ModuleProblem,
        material: Material,
        dilatation: Dilatation = "cell",
        contact: bool = False,
    ) -> None:
        mesh = problem.mesh
        self.problem = problem
        self.globals = Globals.of(problem)
        self.variables = Variables.of(self.globals, dilatation != "point")
        self.cells = cell_data(mesh, dilatation)
        self.material = with_fibres(material_by_cell(mesh, material), problem.fibres, mesh, self.cells)
        wetted = [mesh.cavity]
        if len(problem.actuations) > 1:
            wetted = [mesh.cavities[name] for name in problem.actuations if name in mesh.cavities]
        self.faces = tuple(face_data(faces) for faces in wetted)
        self.volume_m3 = float(self.cells.weight.sum())
        groups = [_dofs(self.cells.nodes), *(_dofs(faces.nodes) for faces in self.faces)]
        held, v, pressure = constraints(problem, self.cells.pressure), mesh.nodes_m.size, self.cells.pressure
        count = 0 if pressure is None else pressure.count
        if pressure is not None:
            both = [v + pressure.places, v + count + pressure.places]
            groups[0] = np.concatenate([groups[0], *both], axis=1)
        self.size = v + 2 * count
        self.displacements, self.volumes = slice(0, v), slice(v, v + count)
        self.pressures = slice(v + count, self.size)
        cellwise = count if pressure is not None and pressure.vertices is None else 0
        self.contacts = Contacts.of(problem, material.shear_modulus_pa, self.volume_m3) if contact else None
        # the skin's nodes share cells: its group adds no entry to the matrix
        groups += [] if self.contacts is None else [_dofs(self.contacts.skin.faces.nodes, 2)]
        self._held = held
        self.pattern, (self._cell_scatter, *scatters) = sparsity(held, groups, cellwise)
        self._face_scatters, self._skin_scatter = scatters[: len(self.faces)], scatters[len(self.faces) :]
        self._rise = _rise_of_end(problem)
        self._face_rows = self._face_operators()
        none = np.zeros((1, self.cells.weight.shape[1], 0))
        self._modes = none if pressure is None else np.ascontiguousarray(pressure.value)
        # slopes of the reference position along the faces' coordinates, which the axial strain e stretches
        self._face_X = [
            np.einsum("fa,qja->fqj", mesh.nodes_m[faces.nodes, 0], faces.slope) for faces in self.faces
        ]

    @property
    def count(self) -> int:
        """Length of x: all dofs and the globals."""
        return self.size + self.globals.count

    def _face_operators(self) -> Rows:
        """Rows B_c (1, q, rows, nodes) of a face's variables, for c = x, y, z; the same on all faces."""
        faces = self.faces[0]
        slope, value = faces.slope[None], faces.value[None, :, None]
        return slope, value, np.concatenate([slope, value], axis=2)

    def positions(self, x: Array) -> Array:
        """X + v of all nodes, (nodes, 3)."""
        return self.problem.mesh.nodes_m + x[self.displacements].reshape(-1, 3)

    def elastic_energy(self, x: Array, second: bool = True) -> Terms | None:
        """U (J) of the piece, its ribbons and what contact stores included; without `second` value and gradient.

        `None` where a cell is inverted or walls went through each other.
        """
        total = self.strain_energy(x, second)
        if total is None:
            return None
        if self.contacts is not None:
            total = self._touching(x, total, second, self.contacts)
            if total is None:
                return None
        more = []
        turn, strain = self.globals.split(x)
        for ribbon in self.problem.ribbons:
            more.append(self._of_globals(*ribbon_energy(ribbon, self.problem.span_m, turn, strain)))
        if self.contacts is not None:
            stored = stop_energy(self.problem, self.contacts.skin, turn, strain)
            more += [self._of_globals(*jet) for jet in stored]
        for terms in more:
            total = total.plus(1.0, terms if second else terms.slope)
        return total

    def _touching(self, x: Array, total: Terms, second: bool, contacts: Contacts) -> Terms | None:
        """Terms with what contact stores; None where walls went through each other."""
        skin, planes = contacts.skin, contacts.planes
        touching = None if planes is None else planes.energy(x, self.globals)
        if touching is not None:
            rows = (skin.faces.value[None, :, None],) * 2
            terms = self._gather(x, touching, skin.weight, rows, self._skin_scatter[0])
            total = total.plus(1.0, terms if second else terms.slope)
        met = contacts.walls.near(x, self.globals.split(x)[1])
        if met is None or not np.any(met.depth_m > 0):
            return None if met is None else total
        pressing = contacts.walls.pressing(met, x, self.globals)
        pattern, (scatter,) = sparsity(self._held, [pressing.dofs])
        none = np.zeros(len(self.pattern.indices))
        terms = self._summed(x, pressing.value_j, pressing.columns, none, scatter)
        if not second:
            return total.plus(1.0, terms.slope)
        values = scatter.values(pressing.matrix, len(pattern.indices))
        return replace(total.plus(1.0, terms), coupling=Coupling(pattern, values))

    def strain_energy(self, x: Array, second: bool = True) -> Terms | None:
        """Strain energy (J) of the piece's solid; `None` where a cell is inverted."""
        cells, G, variables, at = self.cells, self.globals.count, self.variables, self._motion(x)
        dilatation, scatter = self._dilatation(x), self._cell_scatter
        law = (
            pointwise(self.material, at.F)
            if dilatation is None
            else mixed(self.material, at.F, *dilatation, second)
        )
        if law is None:
            return None
        columns = np.zeros((len(cells.nodes), scatter.dofs.shape[1] + G, 1 + G))
        totals = np.zeros(len(self.pattern.indices) if second else 0)
        projected(
            law.stress,
            law.tangent if second else law.tangent[:0],
            at.g,
            at.dg,
            at.first,
            at.bilinear,
            variables.S,
            variables.frame,
            -1 if variables.volume is None else variables.volume,
            -1 if variables.strain is None else variables.strain,
            variables.count,
            cells.weight,
            cells.gradient,
            cells.value,
            self._modes,
            *variables.lateral,
            columns,
            scatter.chosen,
            scatter.slot,
            np.ones(0) if scatter.factor is None else scatter.factor,
            totals,
        )
        terms = self._summed(x, float(np.sum(cells.weight * law.energy)), columns, totals, scatter)
        return terms if second else terms.slope

    def at_points(self, x: Array) -> tuple[Array, Array, Array]:
        """F (m, q, 3, 3) less the rotation, energy per volume (m, q) and P (m, q, 3, 3) at quadrature points."""
        F, dilatation = self._motion(x).F, self._dilatation(x)
        law = pointwise(self.material, F) if dilatation is None else mixed(self.material, F, *dilatation)
        assert law is not None  # x is a state
        return F, law.energy, law.stress[..., :9].reshape(F.shape)

    def volume_ratio(self, x: Array) -> Array | None:
        """ϑ (m, q) of mixed cells."""
        dilatation = self._dilatation(x)
        return None if dilatation is None else 1 + dilatation[0]

    def _motion(self, x: Array) -> RodMotion:
        local = self.positions(x)[self.cells.nodes]
        m, q = self.cells.weight.shape
        S = self.cells.gradient.reshape(m, 3 * q, -1) @ local
        S = S.reshape(m, q, 3, 3).transpose(0, 1, 3, 2)
        k, strain = self.globals.curvature(x)
        return motion(self.variables, S, self._lateral(local, self.cells.value), k, strain)

    def _dilatation(self, x: Array) -> tuple[Array, Array] | None:
        """ϑ − 1 and q/K (m, q) of mixed cells."""
        if self.cells.pressure is None:
            return None
        value, places = self.cells.pressure.value, self.cells.pressure.places
        growth, pressure = (
            (value @ x[part][places][..., None])[..., 0] for part in (self.volumes, self.pressures)
        )
        return growth, pressure

    def travels(self, x: Array) -> tuple[Terms, ...]:
        """What each actuation works on: a cavity of the piece (m³), or its share of the tendon drawn out (m)."""
        found, place = [], 0
        for name in self.problem.actuations:
            if kind_of(name).name == "pressure_pa":
                found.append(self.cavity(x, place))
                place += 1
            else:
                found.append(self.tendon(x))
        return tuple(found)

    def cavity(self, x: Array, place: int = 0) -> Terms:
        """V (m³) of one of the piece's cavities."""
        faces = self.faces[place]
        local = self.positions(x)[faces.nodes]
        slopes = np.einsum("fai,qja->fqij", local, faces.slope)
        rho = self._lateral(local, faces.value)
        k, strain = self.globals.curvature(x)
        density = volume(self.globals, slopes, rho, self._face_X[place], k, strain)
        weight = np.broadcast_to(faces.weight, rho.shape[:2])
        return self._gather(x, density, weight, self._face_rows, self._face_scatters[place])

    def tendon(self, x: Array) -> Terms:
        """The piece's share of the tendon drawn out, w = (deformation_scale / energy_scale) W.

        A module has `deformation_scale` pieces one behind the other that each draw out W: its potential
        −T deformation_scale W is energy_scale times the piece's −T w.
        """
        problem = self.problem
        assert problem.tendon is not None
        turn, strain = self.globals.split(x)
        rise = 0.0 if self._rise is None else float(x[self._rise])
        share = problem.deformation_scale / problem.energy_scale
        value, gradient, hessian = drawn(
            problem.tendon, problem.span_m, problem.reference_z_m, turn, strain, rise
        )
        terms = self._of_globals(share * value, share * gradient[:4], share * hessian[:4, :4])
        if self._rise is not None:
            # W is linear in the rise; only one of the tied nodes carries it
            terms.gradient[self._rise] = share * gradient[4]
            terms.border[self._rise] = share * hessian[4, list(self.globals.active)]
        return terms

    def _lateral(self, local: Array, value: Array) -> Array:
        """ρ (m, q, 2) at quadrature points from local positions (m, nodes, 3)."""
        rho = np.stack([local[:, :, 1] @ value.T, local[:, :, 2] @ value.T], axis=-1)
        rho[..., 1] -= self.problem.reference_z_m
        return rho

    def _of_globals(self, value: float, gradient: Array, hessian: Array) -> Terms:
        """Terms of a function of (Θ_x, Θ_y, Θ_z, e) alone."""
        G, active = self.globals.count, list(self.globals.active)
        full, border = np.zeros(self.count), np.zeros((self.count, G))
        full[self.size :], border[self.size :] = gradient[active], hessian[np.ix_(active, active)]
        return Terms(value, full, np.zeros(len(self.pattern.indices)), border)

    def _gather(self, x: Array, density: Pointwise, weight: Array, rows: Rows, scatter: Scatter) -> Terms:
        """Sum a density over the quadrature points and send it to the dofs."""
        gradient = weight[..., None] * density.gradient
        hessian = weight[..., None, None] * density.hessian
        # right-hand sides: the gradient, and the Hessian's columns of the globals
        local_variables = hessian.shape[-1] - self.globals.count
        columns = np.concatenate([gradient[..., None], hessian[..., local_variables:]], axis=-1)
        local = _project(rows, columns)
        stiffness = _stiffness(rows, hessian)
        matrix = scatter.values(stiffness, len(self.pattern.indices))
        return self._summed(x, float(np.sum(weight * density.value)), local, matrix, scatter)

    def _summed(self, x: Array, value: float, local: Array, matrix: Array, scatter: Scatter) -> Terms:
        """Local columns (m, n + G, 1 + G) sent to the dofs, beside the matrix's values."""
        n = scatter.dofs.shape[1]
        totals = np.concatenate([scatter.totals(local[:, :n], self.size), local[:, n:].sum(axis=0)])
        first, border = self.globals.chain(x, totals[:, 0], totals[:, 1:])
        return Terms(value, first, matrix, border)


def _dofs(nodes: IntArray, components: int = 3) -> IntArray:
    """Local dofs (m, components · nodes), component by component."""
    return np.concatenate([3 * nodes + c for c in range(components)], axis=1)


def _rise_of_end(problem: ModuleProblem) -> int | None:
    """The dof that is the end section's rise where it is tied as one; else the hole stays in its frame."""
    tied = 2 in problem.tied.get("end", ())
    return 3 * int(problem.mesh.node_sets["end"][0]) + 2 if tied else None


def _spans(rows: Rows) -> list[slice]:
    """Places of each component's variables in g."""
    ends = np.cumsum([0] + [block.shape[2] for block in rows])
    return [slice(a, b) for a, b in itertools.pairwise(ends)]


def _project(rows: Rows, columns: Array) -> Array:
    """Σ_q B_cᵀ columns: (m, local dofs + G, k), component by component, then the plain sums for the globals."""
    m, _, _, k = columns.shape
    parts, spans = [], _spans(rows)
    for block, span in zip(rows, spans, strict=True):
        flat = block.reshape(block.shape[0], -1, block.shape[-1])
        parts.append(np.swapaxes(flat, 1, 2) @ columns[:, :, span].reshape(m, -1, k))
    return np.concatenate([*parts, columns[:, :, spans[-1].stop :].sum(axis=1)], axis=1)


def _stiffness(rows: Rows, hessian: Array) -> Array:
    """Σ_q Bᵀ H B: (m, n, n) over local dofs, component by component; blocks below the diagonal stay zero."""
    m, spans = len(hessian), _spans(rows)
    ends = np.cumsum([0] + [block.shape[-1] for block in rows])
    out = np.zeros((m, ends[-1], ends[-1]))
    for d, right in enumerate(rows):
        for c, left in enumerate(rows[: d + 1]):
            product = (hessian[:, :, spans[c], spans[d]] @ right).reshape(m, -1, right.shape[-1])
            flat = left.reshape(left.shape[0], -1, left.shape[-1])
            block = np.swapaxes(flat, 1, 2) @ product
            out[:, ends[c] : ends[c + 1], ends[d] : ends[d + 1]] = block
    return out
