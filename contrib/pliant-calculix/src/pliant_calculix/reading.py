"""Quantities of the piece from an answer: moment and force at the end section, energy, cavity, residual.

CalculiX prints the internal forces f of nodes, before constraints. At equilibrium f = f_p + λ, with f_p the nodal
forces of the pressure on the deformed faces, computed here by the same rules as CalculiX', and λ the reactions at the
end section; λ gives the moment that opposes the actuation.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pliant.interfaces.by_region import material_by_cell
from pliant.interfaces.material import Material
from pliant.records.design import Array
from pliant.records.fem import IntArray
from pliant_calculix.deck import Target
from pliant_calculix.elements import (
    FILL,
    HEXAHEDRON,
    QUADRILATERAL,
    cube_rule,
    square_rule,
    triangle_rule,
    triangle_shapes,
)
from pliant_calculix.model import MM, Model
from pliant_calculix.program import Answer

RULE = {"C3D20": 3, "C3D20R": 2}  # Gauss points along an edge


@dataclass(frozen=True)
class Reaction:
    """Reactions at the end section of the piece, SI.

    Attributes:
        moment_n_m: moment about y that turns the section, zero where the angle is free.
        force_n: force along the section's normal.
        residual_n: largest force at an unconstrained node.
    """

    moment_n_m: float
    force_n: float
    residual_n: float


class Reader:
    """A reader of the answers of one model."""

    def __init__(self, model: Model, material: Material) -> None:
        self.model, self.material = model, material_by_cell(model.problem.mesh, material)
        order = RULE[model.element]
        points, weights = square_rule(order)
        self._faces = (
            (model.cavity, QUADRILATERAL.shapes(points), QUADRILATERAL.slopes(points), weights),
            (
                model.wedges[:, [0, 2, 1, 8, 7, 6]],
                *triangle_shapes(triangle_rule()[0]),
                triangle_rule()[1],
            ),
        )
        points, weights = cube_rule(order)
        jacobian = np.einsum("mai,qaj->mqij", model.places_m[model.cells], HEXAHEDRON.slopes(points))
        self._slopes = np.einsum("qaj,mqji->mqai", HEXAHEDRON.slopes(points), np.linalg.inv(jacobian))
        self._weights = np.linalg.det(jacobian) * weights

    def reaction(self, answer: Answer, pressure_pa: float, theta: float) -> Reaction:
        """Return reaction at an angle θ of the piece (rad)."""
        places = MM * self.model.places_m + answer.displacement[: len(self.model.places_m)]
        held = answer.force[: len(places)] - self._pressure_forces(places, self.model.pa * pressure_pa)
        held = held / self.model.newton
        section = self.model.section
        normal = np.array([np.cos(theta), 0.0, -np.sin(theta)])
        force = held[section] @ normal
        # about the section's own centre, so that a force left over does not count
        arm = (places[section] - places[section].mean(axis=0)) @ np.array([normal[2], 0.0, -normal[0]])
        return Reaction(-1e-3 * float(force @ arm), float(force.sum()), self._residual(held, normal))

    def strain_energy(self, displacement_m: Array) -> float:
        """Return ∫W over the body in J, of nodal displacements (n, 3), by the elements' own rule."""
        gradient = np.einsum("mai,mqaj->mqij", displacement_m[self.model.cells], self._slopes)
        return float(np.sum(self.material.energy(np.eye(3) + gradient) * self._weights))

    def internal_forces(self, displacement_m: Array) -> Array:
        """Return ∂∫W/∂u in N, (n, 3): the program's output if its law is the material."""
        gradient = np.einsum("mai,mqaj->mqij", displacement_m[self.model.cells], self._slopes)
        stress = self.material.evaluate(np.eye(3) + gradient).stress
        forces = np.zeros_like(self.model.places_m)
        np.add.at(
            forces, self.model.cells, np.einsum("mqij,mqaj,mq->mai", stress, self._slopes, self._weights)
        )
        return forces

    def cavity_m3(self, displacement_m: Array) -> float:
        """Return volume of the piece's cavity: −∫ y n_y dA over the wetted faces; other borders add nothing."""
        places = self.model.places_m + displacement_m
        nodes, value, slope, weight = self._faces[0]
        normal = _normals(places, nodes, slope)
        width = np.einsum("qa,fa->fq", value, places[nodes][..., 1])
        return -float(np.einsum("fq,fq,q->", width, normal[..., 1], weight))

    def displacement_m(self, answer: Answer, target: Target) -> Array:
        """Return (n, 3) in m of the mesh's nodes and the cap's; those in no element are interpolated.

        Printed with seven digits, the end section is put back exactly on its plane.
        """
        mesh = self.model.problem.mesh
        moved = answer.displacement[: len(self.model.places_m)] / MM
        rest = np.setdiff1d(np.arange(len(mesh.nodes_m)), self.model.used)
        filled = np.einsum("na,mai->mni", FILL, moved[self.model.cells])
        lonely = np.isin(mesh.cells, rest)
        moved[mesh.cells[lonely]] = filled[lonely]
        return moved

    def _pressure_forces(self, places: Array, pressure: float) -> Array:
        """Return nodal forces (n, 3) of the pressure on the faces at these places (mm), in the deck's units."""
        forces = np.zeros_like(places)
        for nodes, value, slope, weight in self._faces:
            normal = _normals(places, nodes, slope)
            np.add.at(forces, nodes, -pressure * np.einsum("qa,fqi,q->fai", value, normal, weight))
        return forces

    def _residual(self, held: Array, normal: Array) -> float:
        """Return the largest force at unconstrained nodes and along unconstrained directions."""
        left = held.copy()
        section = self.model.section
        left[section] -= (left[section] @ normal)[:, None] * normal
        for node, component in self.model.fixed:
            left[node, component] = 0.0
        # the cap's back hands its forces to the front
        left[np.unique(self.model.wedges)] = 0.0
        left[self.model.plates.bricks] = 0.0
        return float(np.abs(left).max())


def _normals(places: Array, nodes: IntArray, slope: Array) -> Array:
    """Return (f, q, 3) normals times area per reference area, out of the solid."""
    along = np.einsum("fai,qak->fqik", places[nodes], slope)
    return np.cross(along[..., 0], along[..., 1])
