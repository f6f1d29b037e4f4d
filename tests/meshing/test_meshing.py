"""27-node hexahedra, grids and masses by law: closed forms, differences, the divergence theorem."""

from __future__ import annotations

import numpy as np
import pytest

from pliant.meshing.grids import block, carved, grid_cells, grid_faces, grid_lines, module_sets, numbered
from pliant.meshing.hexahedra import (
    CENTRE,
    FACE_CENTRE,
    area_vector,
    boundary_faces,
    cell_volumes,
    enclosed_volume,
    gauss,
    gauss_cube,
    jacobians,
    quadrature,
    sample_points,
    shape_slopes,
    shapes,
)
from pliant.meshing.masses import half_masses, mirrored
from pliant.records.design import Array, MassProperties
from pliant.records.fem import IntArray, ModuleMesh

SIDES = np.array([4e-3, 2e-3, 3e-3])
DENSITY = 1150.0
RNG = np.random.default_rng(7)
POINTS = RNG.uniform(0, 1, (40, 3))
# reference positions of the local nodes i + 3j + 9k
LOCAL = (
    np.stack(np.meshgrid(*[[0.0, 0.5, 1.0]] * 3, indexing="ij"), axis=-1).transpose(2, 1, 0, 3).reshape(-1, 3)
)


def brick(sides: Array = SIDES, elements: int = 2, at: tuple[float, float, float] = (0, 0, 0)) -> Array:
    """Return positions of a box with one corner at a point."""
    return block(*(grid_lines((0.0, side), elements) for side in sides)) + np.array(at)


def meshed(positions: Array) -> tuple[Array, IntArray]:
    nodes, ids = numbered(positions)
    return nodes, grid_cells(ids)


def module_mesh(positions: Array) -> ModuleMesh:
    nodes, cells = meshed(positions)
    return ModuleMesh(nodes, cells, np.empty((0, 9), np.int64), boundary_faces(cells)[0], {})


def bulged(positions: Array) -> Array:
    """Return z (1 + x²/a²) with a the length: quadratic in x, so that quadratic cells represent it exactly."""
    out = positions.copy()
    out[..., 2] *= 1 + (positions[..., 0] / SIDES[0]) ** 2
    return out


def half_cylinder(radius: float, length: float, elements: int) -> Array:
    """Return y ≥ 0 of a solid cylinder about x: a square grid mapped to the disc (s √(1 − q²/2), q √(1 − s²/2))."""
    x, q, s = (
        grid_lines(ends, n) for ends, n in (((0, length), 1), ((0, 1), elements), ((-1, 1), 2 * elements))
    )
    nodes = block(x, q, s)
    q, s = nodes[..., 1], nodes[..., 2]
    y, z = radius * q * np.sqrt(1 - s**2 / 2), radius * s * np.sqrt(1 - q**2 / 2)
    return np.stack([nodes[..., 0], y, z], axis=-1)


def test_shapes_are_one_at_their_own_node_and_sum_to_one() -> None:
    assert np.allclose(shapes(LOCAL), np.eye(27), atol=1e-15)
    assert np.allclose(shapes(POINTS).sum(axis=1), 1, atol=1e-14)
    assert np.allclose(shape_slopes(POINTS).sum(axis=1), 0, atol=1e-13)


def test_shapes_reproduce_quadratics() -> None:
    def f(x: Array) -> Array:
        return x[:, 0] ** 2 * x[:, 1] ** 2 * x[:, 2] ** 2 - 3 * x[:, 0] * x[:, 2] + x[:, 1]

    assert np.allclose(shapes(POINTS) @ f(LOCAL), f(POINTS), atol=1e-14)


@pytest.mark.parametrize("axis", range(3))
def test_slopes_equal_differences(axis: int) -> None:
    step = 1e-5 * np.eye(3)[axis]
    difference = (shapes(POINTS + step) - shapes(POINTS - step)) / 2e-5
    assert np.allclose(shape_slopes(POINTS)[..., axis], difference, atol=1e-9)


@pytest.mark.parametrize("order", range(1, 6))
def test_gauss_is_exact_to_twice_its_order(order: int) -> None:
    point, weight = gauss(order)
    degrees = np.arange(2 * order + 1)
    error = [abs(weight @ point**n - 1 / (n + 1)) for n in degrees]
    assert max(error[:-1]) < 1e-15
    assert error[-1] > 1e-6
    points, weights = gauss_cube(order)
    assert weights.sum() == pytest.approx(1)
    assert weights @ points == pytest.approx([0.5, 0.5, 0.5])


def test_quadrature_is_exact_at_the_orders_it_names() -> None:
    """For a cell with all nodes moved at random: volume at order 3, first moments at 4, second moments at 5."""
    nodes = LOCAL + RNG.uniform(-0.08, 0.08, LOCAL.shape)
    cell = np.arange(27)[None]

    def moment(degree: int, order: int) -> float:
        points, volumes = quadrature(nodes, cell, order)
        return float((volumes * points[..., 0] ** degree).sum())

    for degree in (0, 1, 2):
        exact = moment(degree, 8)
        assert moment(degree, 3 + degree) == pytest.approx(exact, rel=1e-13)
        assert moment(degree, 2 + degree) != pytest.approx(exact, rel=1e-12)


@pytest.mark.parametrize("elements", [1, 3])
def test_brick_volume(elements: int) -> None:
    nodes, cells = meshed(brick(elements=elements))
    assert cells.shape == (elements**3, 27)
    volumes = cell_volumes(nodes, cells)
    assert volumes == pytest.approx(SIDES.prod() / elements**3, rel=1e-12)
    assert np.allclose(jacobians(nodes, cells, sample_points()), volumes[:, None], rtol=1e-12)


def test_volume_in_a_solid_with_a_quadratic_face() -> None:
    """∫ (1 + x²/a²) dx = 4a/3, by cells and by faces."""
    nodes, cells = meshed(bulged(brick()))
    wanted = 4 / 3 * SIDES.prod()
    assert cell_volumes(nodes, cells).sum() == pytest.approx(wanted, rel=1e-13)
    assert enclosed_volume(nodes, boundary_faces(cells)[0]) == pytest.approx(wanted, rel=1e-13)


def test_a_grid_that_runs_left_handed_has_negative_volume() -> None:
    nodes, ids = numbered(brick())
    assert cell_volumes(nodes, grid_cells(ids[:, ::-1])).max() < 0


def test_local_nodes_are_lexicographic() -> None:
    nodes, cells = meshed(brick(elements=1))
    assert nodes[cells[0]] == pytest.approx(LOCAL * SIDES)


def test_boundary_faces_are_closed_and_point_away_from_their_owners() -> None:
    nodes, cells = meshed(bulged(brick(elements=3)))
    faces, owners = boundary_faces(cells)
    assert len(faces) == 6 * 9
    assert np.abs(area_vector(nodes, faces)).max() < 1e-15 * SIDES.max()
    for face, owner in zip(faces, owners, strict=True):
        assert set(face) <= set(cells[owner])
        outward = nodes[face[FACE_CENTRE]] - nodes[cells[owner, CENTRE]]
        assert area_vector(nodes, face[None]) @ outward > 0


def test_layer_faces_have_the_area_i_across_j() -> None:
    nodes, ids = numbered(brick())
    area = area_vector(nodes, grid_faces(ids[:, :, -1]))
    assert area == pytest.approx([0, 0, SIDES[0] * SIDES[1]], abs=1e-18)
    assert area_vector(nodes, grid_faces(ids[:, :, -1].T)) == pytest.approx(-area, abs=1e-18)
    assert area_vector(nodes, grid_faces(ids[-1])) == pytest.approx([SIDES[1] * SIDES[2], 0, 0], abs=1e-18)


def test_grid_lines_keep_their_ends() -> None:
    ends = (0.0, 0.1, 0.3, 0.7)
    lines = grid_lines(ends, 3)
    assert len(lines) == 3 * 6 + 1
    assert tuple(lines[::6]) == ends
    assert np.allclose(np.diff(lines)[:6], 0.1 / 6)


def test_a_carved_body_is_closed_inside_and_outside() -> None:
    nodes, cells = meshed(bulged(brick(elements=3)))
    centre = nodes[cells[:, CENTRE]]
    middle = SIDES / 2 * [1, 1, 1.25]  # the bulge raises the middle cell's centre
    hollow = np.linalg.norm(centre - middle, axis=1) < 1e-12
    assert hollow.sum() == 1
    left_nodes, left, cavity = carved(nodes, cells, hollow)
    assert np.array_equal(np.unique(left), np.arange(len(left_nodes)))
    assert len(nodes) - len(left_nodes) == 1
    assert len(cavity) == 6
    # seen from the solid the cavity is inside out
    gone = cell_volumes(nodes, cells[hollow]).sum()
    assert enclosed_volume(left_nodes, cavity) == pytest.approx(-gone, rel=1e-12)
    whole = cell_volumes(left_nodes, left).sum()
    assert whole == pytest.approx(4 / 3 * SIDES.prod() - gone, rel=1e-12)
    assert enclosed_volume(left_nodes, boundary_faces(left)[0]) == pytest.approx(whole, rel=1e-12)


def test_module_sets_are_planes_and_a_point() -> None:
    nodes, ids = numbered(brick())
    sets = module_sets(nodes, SIDES[0], (0.0, 0.0, SIDES[2]))
    assert np.array_equal(sets["start"], ids[0].ravel())
    assert np.array_equal(sets["end"], ids[-1].ravel())
    assert np.array_equal(sets["symmetry"], np.sort(ids[:, 0].ravel()))
    assert np.array_equal(sets["pin"], ids[0, 0, -1:])


@pytest.mark.parametrize("mirror_y", [True, False])
def test_brick_masses(mirror_y: bool) -> None:
    """Half the width and its image, or a whole brick on one side of the plane y = 0."""
    end = half_masses(module_mesh(brick(at=(0, 0, 1e-3))), DENSITY, mirror_y).end
    sides = SIDES * [1, 2 if mirror_y else 1, 1]
    mass = DENSITY * sides.prod()
    assert end.mass_kg == pytest.approx(mass, rel=1e-13)
    wanted = [sides[0] / 2, 0 if mirror_y else sides[1] / 2, 1e-3 + sides[2] / 2]
    assert end.com_m == pytest.approx(wanted, rel=1e-13)
    inertia = mass / 12 * (sides @ sides * np.eye(3) - np.diag(sides**2))
    assert np.allclose(end.inertia_kg_m2, inertia, rtol=1e-12, atol=1e-13 * inertia.max())


def test_half_cylinder_masses_converge_to_the_cylinders() -> None:
    R, length = 6e-3, 5e-3
    mass = DENSITY * np.pi * R**2 * length
    across = mass * (3 * R**2 + length**2) / 12
    inertia = np.diag([mass * R**2 / 2, across, across])
    errors = []
    for elements in (2, 4):
        end = half_masses(module_mesh(half_cylinder(R, length, elements)), DENSITY).end
        assert end.com_m == pytest.approx([length / 2, 0, 0], abs=1e-15)
        off = end.inertia_kg_m2 - inertia
        errors.append((abs(end.mass_kg / mass - 1), np.abs(off).max() / inertia.max()))
    assert max(errors[1]) < 2e-4
    assert np.all(np.divide(*errors) > 8)  # at least third order


def test_the_start_half_is_the_end_halfs_image() -> None:
    mass = half_masses(module_mesh(bulged(brick())), DENSITY)
    whole = mass.start.joined(mass.end)
    assert mass.start.mass_kg == mass.end.mass_kg
    assert whole.com_m[:2] == pytest.approx([0, 0], abs=1e-18)
    off = whole.inertia_kg_m2 - np.diag(np.diag(whole.inertia_kg_m2))
    assert np.abs(off).max() < 1e-13 * np.abs(whole.inertia_kg_m2).max()
    # the bulge is asymmetric: its own half has a product of inertia, of opposite sign in the image
    assert mass.end.inertia_kg_m2[0, 2] < 0
    assert mass.start.inertia_kg_m2[0, 2] == pytest.approx(-mass.end.inertia_kg_m2[0, 2])


@pytest.mark.parametrize("axis", range(3))
def test_twice_mirrored_is_itself(axis: int) -> None:
    root = RNG.uniform(-1, 1, (3, 3))
    piece = MassProperties(0.3, RNG.uniform(-1, 1, 3), root @ root.T)
    once, twice = mirrored(piece, axis), mirrored(mirrored(piece, axis), axis)
    assert once.com_m[axis] == -piece.com_m[axis]
    assert np.allclose(twice.com_m, piece.com_m)
    assert np.allclose(twice.inertia_kg_m2, piece.inertia_kg_m2)
