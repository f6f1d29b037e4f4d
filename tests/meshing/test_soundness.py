"""Mistakes in a problem are reported before it is solved, each in one sentence."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pliant.errors import ContractError, UserError
from pliant.meshing.cells import area_vectors, boundary_faces, cell_volumes, loose_edges
from pliant.meshing.piece import piece_mesh
from pliant.meshing.soundness import found_wrong, hollows_found
from pliant.pipeline.dataset import require_sound
from pliant.records.fem import Link, ModuleProblem
from pliant.registry.discovery import discover
from pliant.testing import Subject
from pliant.testing.box import BoxShape, box_problem

BOX = box_problem(BoxShape((0.0, 3e-3, 4.5e-3), (0.0, 3e-3, 7e-3, 8.5e-3), 6e-3), 2)
FAMILIES = [
    one
    for one in discover().components
    if one.interface == "family" and one.implementation.startswith("pliant_plugins.")
]


def remeshed(**changes: Any) -> ModuleProblem:
    return replace(BOX, mesh=replace(BOX.mesh, **changes))


def on(axis: int, place: float) -> np.ndarray:
    """Return outer faces of the box in a plane."""
    skin, nodes = BOX.mesh.skin, BOX.mesh.nodes_m
    return skin[np.all(np.abs(nodes[skin, axis] - place) < 1e-12, axis=1)]


@pytest.mark.parametrize("component", FAMILIES, ids=lambda one: one.kind)
def test_what_ships_is_sound(component):
    family = Subject(component).build()
    assert found_wrong(family.problem()) == ""
    assert found_wrong(family.problem(axes=(family.main_axis,))) == ""


@pytest.mark.parametrize("lost", [1, 3, 5])
def test_every_face_that_a_cavity_lacks_is_a_leak(lost):
    """An edge of a lost face has one face left, unless it is in a plane in which the module continues."""
    rng, cavity = np.random.default_rng(lost), BOX.mesh.cavity
    for _ in range(10):
        kept = np.sort(rng.permutation(len(cavity))[lost:])
        assert "the cavity leaks" in found_wrong(remeshed(cavity=cavity[kept]))


def test_the_leak_place_equals_the_face():
    cavity = BOX.mesh.cavity
    middle = BOX.mesh.nodes_m[cavity].mean(axis=1)
    inner = int(np.argmin(np.linalg.norm(middle - middle.mean(axis=0), axis=1)))
    said = found_wrong(remeshed(cavity=np.delete(cavity, inner, axis=0)))
    place = np.array([float(x) for x in said.split("the first at (")[1].split(")")[0].split(", ")])
    assert np.linalg.norm(place - middle[inner]) < 2e-3


def test_outer_faces_are_no_cavity():
    floor = on(2, 0.0)
    assert "the cavity leaks" in found_wrong(remeshed(cavity=np.vstack([BOX.mesh.cavity, floor])))
    outside = np.vstack([floor, on(2, 8.5e-3), on(1, 4.5e-3)])
    assert "goes around the solid" in found_wrong(remeshed(cavity=outside)).replace(
        "go around", "goes around"
    )
    with_ends = np.vstack([BOX.mesh.cavity, on(0, 0.0)])
    assert "lie in the plane x = 0, where the module continues" in found_wrong(remeshed(cavity=with_ends))


def test_a_closed_skin_has_no_loose_edges():
    assert not len(loose_edges(boundary_faces(BOX.mesh.cells)[0]))
    assert len(loose_edges(BOX.mesh.skin[:1])) == 4


@pytest.mark.parametrize(
    ("spoiled", "says"),
    [
        (remeshed(cavity=BOX.mesh.cavity[:0]), "the cavity has no faces"),
        (remeshed(cavity=BOX.mesh.cavity[:, ::-1]), ""),  # turned about its middle: the same normal
        (remeshed(cells=BOX.mesh.cells[:, ::-1]), r"elements are inverted .* at \("),
        (remeshed(nodes_m=np.vstack([BOX.mesh.nodes_m, [[0.0, 0.0, 1e-3]]])), "1 nodes belong to no element"),
        (replace(BOX, span_m=6.0), "the mesh reaches from x = 0 to 0.006 m, the piece from 0 to 6 m"),
        (remeshed(node_sets={}), "there is no node set 'start'"),
        (replace(BOX, fixed={"start": (0,), "end": (0,), "symmetry": (1,)}), "the supports hold 5 of 6"),
        (replace(BOX, fixed={**BOX.fixed, "pni": (2,)}), "node set 'pni' is used but does not exist"),
    ],
)
def test_each_mistake_has_its_sentence(spoiled, says):
    found = found_wrong(spoiled)
    if not says:
        assert found == ""
        return
    with pytest.raises(UserError, match=f"mesh of the family 'mine' .*{says}.* 'pliant check family mine'"):
        require_sound(spoiled, "mine")


CORNERS = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]
# A cube as six tetrahedra around its diagonal from corner 0 to corner 6 (Kuhn).
KUHN = np.array([[0, 1, 2, 6], [0, 2, 3, 6], [0, 3, 7, 6], [0, 7, 4, 6], [0, 4, 5, 6], [0, 5, 1, 6]])


def boxes() -> tuple[np.ndarray, np.ndarray]:
    """Return corners and eight-node cells in VTK's order of the box's own mesh."""
    lexicographic = [2 * i + 6 * j + 18 * k for i, j, k in CORNERS]
    return BOX.mesh.nodes_m, BOX.mesh.cells[:, lexicographic]


def chamber(middles: np.ndarray) -> np.ndarray:
    _, y, z = middles.T
    return (y < 3e-3 + 1e-9) & (z > 3e-3 - 1e-9) & (z < 7e-3 + 1e-9)


@pytest.mark.parametrize("kind", ["hexahedron", "tetra"])
def test_mesher_cells_become_the_mesh_for_a_piece(kind):
    nodes, cells = boxes()
    if kind == "tetra":
        cells = cells[:, KUHN].reshape(-1, 4)
        turned = np.random.default_rng(1).random(len(cells)) < 0.5  # of either orientation
        cells = np.where(turned[:, None], cells[:, [1, 0, 2, 3]], cells)
    jitter = 1e-12 * np.random.default_rng(2).standard_normal(nodes.shape)
    mesh = piece_mesh(nodes + jitter, kind, cells, BOX.span_m, chamber)
    assert found_wrong(replace(BOX, mesh=mesh)) == ""
    assert cell_volumes(mesh.nodes_m, mesh.cells).sum() == pytest.approx(
        cell_volumes(BOX.mesh.nodes_m, BOX.mesh.cells).sum(), rel=1e-9
    )
    area = area_vectors(mesh.nodes_m, mesh.cavity)
    assert np.abs(area).sum() == pytest.approx(
        np.abs(area_vectors(BOX.mesh.nodes_m, BOX.mesh.cavity)).sum(), rel=1e-9
    )
    with pytest.raises(ContractError, match="cells are 'wedge'"):
        piece_mesh(nodes, "wedge", cells, BOX.span_m, chamber)


def test_each_pressure_has_its_own_faces():
    nodes, cells = boxes()
    halves = {
        "pressure_1_pa": lambda at: chamber(at) & (at[:, 2] > 5e-3),
        "pressure_2_pa": lambda at: chamber(at) & (at[:, 2] < 5e-3),
    }
    mesh = piece_mesh(nodes, "hexahedron", cells, BOX.span_m, halves)
    assert sum(map(len, mesh.cavities.values())) == len(mesh.cavity) == len(BOX.mesh.cavity)
    # one chamber for two pressures: each half is open toward the other
    two = replace(BOX, mesh=mesh, actuation="pressure_1_pa, pressure_2_pa")
    assert "the cavity of 'pressure_1_pa' leaks" in found_wrong(two)


def test_planes_may_lie_anywhere_and_linked_edges_are_no_leak():
    """A piece moved along y keeps its plane of symmetry; with links in the place of the plane it is open there only."""
    moved = remeshed(nodes_m=BOX.mesh.nodes_m + np.array([0.0, -20e-3, 0.0]))
    assert found_wrong(moved) == ""
    free = {name: parts for name, parts in BOX.fixed.items() if name != "symmetry"}
    assert "leaks" in next(hollows_found(replace(BOX, fixed=free)))
    first, second = np.split(BOX.mesh.node_sets["symmetry"], 2)
    linked = replace(BOX, fixed=free, links=(Link(first, second, {2: 1.0}),))
    assert next(hollows_found(linked), "") == ""
