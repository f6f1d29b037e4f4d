"""Bodies of several modules: volumes add up, the cap closes the cavity, cells stay sound."""

from __future__ import annotations

import numpy as np
import pytest

from pliant.errors import ContractError
from pliant.meshing.hexahedra import FACE_CENTRE, cell_volumes, enclosed_volume, gauss, lagrange
from pliant.meshing.stacking import capped, half_disc, mirrored_mesh, stacked
from pliant.records.fem import ModuleMesh
from pliant_plugins.families.bellow_bending.family import BellowBending, BellowBendingConfig
from pliant_plugins.families.bellow_bending.mesh import BellowGeometry


@pytest.fixture(scope="module")
def family() -> BellowBending:
    lengths = {"inner_radius": 2e-3, "average_radius": 6e-3, "wall": 1.5e-3, "module_length": 11e-3}
    return BellowBending(BellowBendingConfig.model_validate(lengths))


@pytest.mark.parametrize("elements", [3, 4, 7, 10, 14])
def test_a_half_disc_fills_its_ring(elements: int) -> None:
    angle = np.linspace(0, np.pi, 2 * elements + 1)
    ring = np.column_stack([np.sin(angle), -np.cos(angle)])
    nodes, faces = half_disc(ring)
    assert np.array_equal(nodes[: len(ring)], ring)
    corners = nodes[faces[:, [0, 2, 8, 6]]]
    x, y = corners[..., 0], corners[..., 1]
    area = 0.5 * np.sum(x * np.roll(y, -1, 1) - y * np.roll(x, -1, 1), axis=1)
    assert np.all(area > 0) or np.all(area < 0)  # all turn the same way, none is folded
    chords = elements * np.sin(np.pi / elements) / 2  # area of the polygon through the ring's corners
    assert np.abs(area).sum() == pytest.approx(chords, rel=1e-9)


def test_a_ring_without_room_is_refused() -> None:
    with pytest.raises(ContractError, match="ring"):
        half_disc(np.zeros((5, 2)))


def test_a_mirrored_mesh_keeps_its_volume_and_its_sides(family: BellowBending) -> None:
    mesh = family.problem().mesh
    image = mirrored_mesh(mesh)
    volumes = cell_volumes(image.nodes_m, image.cells)
    assert volumes == pytest.approx(cell_volumes(mesh.nodes_m, mesh.cells))
    assert enclosed_volume(image.nodes_m, image.skin) == pytest.approx(volumes.sum())


@pytest.mark.parametrize("modules", [1, 3])
def test_a_stack_has_the_modules_volume(family: BellowBending, modules: int) -> None:
    problem = family.problem()
    body = stacked(problem.mesh, problem.span_m, modules)
    one = problem.energy_scale * cell_volumes(problem.mesh.nodes_m, problem.mesh.cells).sum()
    assert 2 * cell_volumes(body.nodes_m, body.cells).sum() == pytest.approx(modules * one, rel=1e-12)
    assert loose_faces(body) == 0
    assert body.nodes_m[:, 0].max() == pytest.approx(modules * family.module_length_m)


def test_the_cap_closes_the_cavity(family: BellowBending) -> None:
    problem, cap = family.problem(), 3e-3
    length = 2 * family.module_length_m
    body = capped(stacked(problem.mesh, problem.span_m, 2), length, cap)
    assert loose_faces(body) == 0
    assert cell_volumes(body.nodes_m, body.cells).min() > 0
    geometry: BellowGeometry = family.geometry
    inside = -2 * _flux(body.nodes_m - np.array([0, 0, geometry.axis_height_m]), body.cavity, (1, 2)) / 2
    # the open base is in x = 0, where a field along x has no flux
    assert inside == pytest.approx(-2 * _flux(body.nodes_m, body.cavity, (0,)), rel=1e-12)
    assert inside == pytest.approx(2 * geometry.cavity_volume(), rel=1e-3)


def loose_faces(mesh: ModuleMesh) -> int:
    """Return faces of the cavity that are not on the skin."""
    return int(np.sum(~np.isin(mesh.cavity[:, FACE_CENTRE], mesh.skin[:, FACE_CENTRE])))


def _flux(nodes: np.ndarray, faces: np.ndarray, components: tuple[int, ...]) -> float:
    """Return ∫ x_c n_c dA over the faces, summed over the components."""
    return sum(_one(nodes, faces, c) for c in components)


def _one(nodes: np.ndarray, faces: np.ndarray, component: int) -> float:
    """Return ∫ x_c n_c dA of one component c."""
    point, weight = gauss()
    value, slope = lagrange(point)
    corner = nodes[faces].reshape(-1, 3, 3, 3)
    place = np.einsum("qa,rb,fba->fqr", value, value, corner[..., component])
    a = np.einsum("qa,rb,fbai->fqri", slope, value, corner)
    b = np.einsum("qa,rb,fbai->fqri", value, slope, corner)
    return float(np.einsum("fqr,fqr,q,r->", place, np.cross(a, b)[..., component], weight, weight))


def test_the_body_names_clamp_markers_and_sections(family: BellowBending) -> None:
    body = family.structure(3)
    nodes, length = body.mesh.nodes_m, family.module_length_m
    assert nodes[body.markers, 0] == pytest.approx(length * np.array([0, 0.5, 1.5, 2.5, 3]))
    assert nodes[body.markers, 1:] == pytest.approx(0, abs=1e-12)
    assert [nodes[s, 0].mean() for s in body.sections] == pytest.approx([k * length for k in range(4)])
    assert body.tip_shares.sum() == pytest.approx(1)
    assert nodes[body.tip, 0] == pytest.approx(3 * length)
    assert set(body.fixed) <= set(body.mesh.node_sets)
