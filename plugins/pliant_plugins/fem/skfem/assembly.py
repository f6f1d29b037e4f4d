"""From densities at quadrature points to the system's vectors and matrices, batched over cells.

The unknowns are x: displacements v, volumes and pressures of mixed cells, globals (`unknowns`). A density's variables
g are linear in the local ones, one block of rows B_c per component c, so that

    r_c = Σ_q B_cᵀ ∂w/∂g_c,    K_cd = Σ_q B_cᵀ ∂²w/∂g_c∂g_d B_d

are products of small matrices. The globals' columns are kept apart from the sparse matrix over v.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from pliant.interfaces.material import Material
from pliant.records.actuation import actuation_kind
from pliant.records.design import Array
from pliant.records.fem import IntArray, ModuleProblem
from pliant_plugins.fem.config import Dilatation
from pliant_plugins.fem.skfem.basis import cell_data, face_data
from pliant_plugins.fem.skfem.dilatation import mixed, pointwise
from pliant_plugins.fem.skfem.kernel import projected
from pliant_plugins.fem.skfem.kinematics import Pointwise, RodMotion, Variables, motion
from pliant_plugins.fem.skfem.pattern import Coupling, Rows, Scatter, Terms, sparsity
from pliant_plugins.fem.skfem.potentials import drawn, ribbon_energy, volume
from pliant_plugins.fem.skfem.unknowns import Globals, constraints

if TYPE_CHECKING:
    from pliant_plugins.fem.skfem.walls import Contacts

Bent = tuple[Array, float]  # k (3,) and e of `Globals.curvature`


class Assembler:
    """Assembly of the elastic energy U(x) of one problem and of the conjugates of its actuation.

    Attributes:
        size: number of dofs, the globals left out.
        displacements, volumes, pressures: places of v, ϑ and q in x; U is stationary but not least in q.
        contacts: possible contacts of the skin; None if contact is not solved.
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
        self.globals = Globals.from_problem(problem)
        self.variables = Variables.from_globals(self.globals, dilatation != "point")
        self.cells = cell_data(mesh, dilatation)
        self.material = self._material(material)
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
        self.contacts = self._contacts(material) if contact else None
        # the skin's nodes share cells: its group adds no entry to the matrix
        groups += [] if self.contacts is None else [_dofs(self.contacts.skin.faces.nodes, 2)]
        self._held = held
        self.pattern, (self._cell_scatter, *scatters) = sparsity(held, groups, cellwise)
        self._face_scatters, self._skin_scatter = scatters[: len(self.faces)], scatters[len(self.faces) :]
        self._rise = _end_rise_dof(problem)
        self._face_rows = self._face_operators()
        none = np.zeros((1, self.cells.weight.shape[1], 0))
        self._modes = none if pressure is None else np.ascontiguousarray(pressure.value)
        # slopes of the reference position along the faces' coordinates, which the axial strain e stretches
        self._face_X = [
            np.einsum("fa,qja->fqj", mesh.nodes_m[faces.nodes, 0], faces.slope) for faces in self.faces
        ]

    def _material(self, material: Material) -> Material:
        """Return the law at quadrature points, by region and with fibres where the module has them."""
        if self.problem.mesh.regions:
            from pliant.interfaces.by_region import ByRegion

            material = ByRegion(self.problem.mesh, material)
        if self.problem.fibres:
            from pliant_plugins.fem.skfem.fibres import with_fibres

            material = with_fibres(material, self.problem.fibres, self.problem.mesh, self.cells)
        return material

    def _contacts(self, material: Material) -> Contacts | None:
        """Return the possible contacts of the skin, whose modules are loaded only where contact is solved."""
        from pliant_plugins.fem.skfem.walls import Contacts

        return Contacts.from_problem(self.problem, material.shear_modulus_pa, self.volume_m3)

    @property
    def count(self) -> int:
        """Length of x: all dofs and the globals."""
        return self.size + self.globals.count

    def _face_operators(self) -> Rows:
        """Return rows B_c (1, q, rows, nodes) of a face's variables, for c = x, y, z; the same on all faces."""
        faces = self.faces[0]
        slope, value = faces.slope[None], faces.value[None, :, None]
        return Rows(slope, value, np.concatenate([slope, value], axis=2))

    def positions(self, x: Array) -> Array:
        """Return X + v of all nodes, (nodes, 3)."""
        return self.problem.mesh.nodes_m + x[self.displacements].reshape(-1, 3)

    def elastic_energy(self, x: Array, second: bool = True) -> Terms | None:
        """Return U (J) of the piece with ribbons and contact; without `second`, value and gradient only.

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
            more.append(self._global_terms(*ribbon_energy(ribbon, self.problem.span_m, turn, strain)))
        if self.contacts is not None:
            from pliant_plugins.fem.skfem.stops import stop_energy

            stored = stop_energy(self.problem, self.contacts.skin, turn, strain)
            more += [self._global_terms(*jet) for jet in stored]
        for terms in more:
            total = total.plus(1.0, terms if second else terms.slope)
        return total

    def _touching(self, x: Array, total: Terms, second: bool, contacts: Contacts) -> Terms | None:
        """Return terms with the contact energy; None if walls passed through each other."""
        skin, planes, bent = contacts.skin, contacts.planes, self.globals.curvature(x)
        touching = None if planes is None else planes.energy(x, self.globals)
        if touching is not None:
            rows = Rows(*(skin.faces.value[None, :, None],) * 2)
            (skin_scatter,) = self._skin_scatter
            local = self._local(touching, skin.weight, rows, skin_scatter)
            terms = self._summed(bent, *local, skin_scatter)
            total = total.plus(1.0, terms if second else terms.slope)
        met = contacts.walls.near(x, self.globals.split(x)[1])
        if met is None or not np.any(met.depth_m > 0):
            return None if met is None else total
        pressing = contacts.walls.pressing(met, x, self.globals)
        pattern, (scatter,) = sparsity(self._held, [pressing.dofs])
        none = np.zeros(len(self.pattern.indices))
        terms = self._summed(bent, pressing.value_j, pressing.columns, none, scatter)
        if not second:
            return total.plus(1.0, terms.slope)
        values = scatter.values(pressing.matrix, len(pattern.indices))
        return replace(total.plus(1.0, terms), coupling=Coupling(pattern, values))

    def strain_energy(self, x: Array, second: bool = True) -> Terms | None:
        """Return strain energy (J) of the piece's solid; `None` where a cell is inverted."""
        cells, G, variables = self.cells, self.globals.count, self.variables
        bent = self.globals.curvature(x)
        at = self._motion(x, bent)
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
        terms = self._summed(bent, float(np.sum(cells.weight * law.energy)), columns, totals, scatter)
        return terms if second else terms.slope

    def at_points(self, x: Array) -> tuple[Array, Array, Array]:
        """Return F (m, q, 3, 3) less the rotation, energy per volume (m, q) and P (m, q, 3, 3) at quadrature points."""
        F, dilatation = self._motion(x, self.globals.curvature(x)).F, self._dilatation(x)
        law = pointwise(self.material, F) if dilatation is None else mixed(self.material, F, *dilatation)
        assert law is not None  # x is a state
        return F, law.energy, law.stress[..., :9].reshape(F.shape)

    def volume_ratio(self, x: Array) -> Array | None:
        """Return ϑ (m, q) of mixed cells."""
        dilatation = self._dilatation(x)
        return None if dilatation is None else 1 + dilatation[0]

    def _motion(self, x: Array, bent: Bent) -> RodMotion:
        local = self.positions(x)[self.cells.nodes]
        m, q = self.cells.weight.shape
        S = self.cells.gradient.reshape(m, 3 * q, -1) @ local
        S = S.reshape(m, q, 3, 3).transpose(0, 1, 3, 2)
        return motion(self.variables, S, self._lateral(local, self.cells.value), *bent)

    def _dilatation(self, x: Array) -> tuple[Array, Array] | None:
        """Return ϑ − 1 and q/K (m, q) of mixed cells."""
        if self.cells.pressure is None:
            return None
        value, places = self.cells.pressure.value, self.cells.pressure.places
        growth, pressure = (
            (value @ x[part][places][..., None])[..., 0] for part in (self.volumes, self.pressures)
        )
        return growth, pressure

    def travels(self, x: Array) -> tuple[Terms, ...]:
        """Return the conjugate of each actuation: the volume of a cavity (m³) or the piece's share of the drawn tendon
        (m).
        """
        found, place = [], 0
        for name in self.problem.actuations:
            if actuation_kind(name).name == "pressure_pa":
                found.append(self.cavity(x, place))
                place += 1
            else:
                found.append(self.tendon(x))
        return tuple(found)

    def cavity(self, x: Array, place: int = 0) -> Terms:
        """Return V (m³) of one of the piece's cavities."""
        faces = self.faces[place]
        local = self.positions(x)[faces.nodes]
        slopes = np.einsum("fai,qja->fqij", local, faces.slope)
        rho = self._lateral(local, faces.value)
        bent = self.globals.curvature(x)
        density = volume(self.globals, slopes, rho, self._face_X[place], *bent)
        weight, scatter = np.broadcast_to(faces.weight, rho.shape[:2]), self._face_scatters[place]
        return self._summed(bent, *self._local(density, weight, self._face_rows, scatter), scatter)

    def tendon(self, x: Array) -> Terms:
        """Return the piece's share of the tendon drawn out, w = (deformation_scale / energy_scale) W.

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
        terms = self._global_terms(share * value, share * gradient[:4], share * hessian[:4, :4])
        if self._rise is not None:
            # W is linear in the rise; only one of the tied nodes carries it
            terms.gradient[self._rise] = share * gradient[4]
            terms.border[self._rise] = share * hessian[4, list(self.globals.active)]
        return terms

    def _lateral(self, local: Array, value: Array) -> Array:
        """Return ρ (m, q, 2) at quadrature points from local positions (m, nodes, 3)."""
        rho = np.stack([local[:, :, 1] @ value.T, local[:, :, 2] @ value.T], axis=-1)
        rho[..., 1] -= self.problem.reference_z_m
        return rho

    def _global_terms(self, value: float, gradient: Array, hessian: Array) -> Terms:
        """Return terms of a function of (Θ_x, Θ_y, Θ_z, e) alone."""
        G, active = self.globals.count, list(self.globals.active)
        full, border = np.zeros(self.count), np.zeros((self.count, G))
        full[self.size :], border[self.size :] = gradient[active], hessian[np.ix_(active, active)]
        return Terms(value, full, np.zeros(len(self.pattern.indices)), border)

    def _local(
        self, density: Pointwise, weight: Array, rows: Rows, scatter: Scatter
    ) -> tuple[float, Array, Array]:
        """Return the sum of a density over the quadrature points, its local columns and the matrix's values."""
        gradient = weight[..., None] * density.gradient
        hessian = weight[..., None, None] * density.hessian
        # right-hand sides: the gradient, and the Hessian's columns of the globals
        local_variables = hessian.shape[-1] - self.globals.count
        columns = np.concatenate([gradient[..., None], hessian[..., local_variables:]], axis=-1)
        local = rows.project(columns)
        stiffness = rows.stiffness(hessian)
        matrix = scatter.values(stiffness, len(self.pattern.indices))
        return float(np.sum(weight * density.value)), local, matrix

    def _summed(self, bent: Bent, value: float, local: Array, matrix: Array, scatter: Scatter) -> Terms:
        """Sum local columns (m, n + G, 1 + G) into the dofs and combine them with the matrix's values."""
        n = scatter.dofs.shape[1]
        totals = np.concatenate([scatter.totals(local[:, :n], self.size), local[:, n:].sum(axis=0)])
        first, border = self.globals.chain(bent, totals[:, 0], totals[:, 1:])
        return Terms(value, first, matrix, border)


def _dofs(nodes: IntArray, components: int = 3) -> IntArray:
    """Return local dofs (m, components · nodes), component by component."""
    return np.concatenate([3 * nodes + c for c in range(components)], axis=1)


def _end_rise_dof(problem: ModuleProblem) -> int | None:
    """Return the dof of the end section's rise if it is tied as one; else the hole stays in its frame."""
    tied = 2 in problem.tied.get("end", ())
    return 3 * int(problem.mesh.node_sets["end"][0]) + 2 if tied else None
