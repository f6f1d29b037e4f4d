"""Objects of a grasp: shapes, masses and positions by closed form; refused objects."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
from pydantic import ValidationError

from pliant.errors import UserError
from pliant_plugins.tasks.grasp.task import Grasp

Tasks = Callable[..., Grasp]


def test_an_egg_is_an_ellipsoid_on_a_foot(grasp: Tasks) -> None:
    body = grasp().target.body
    egg, foot = body.shapes
    assert egg.size_m == pytest.approx((0.030, 0.030, 0.0325))
    assert body.position_m == pytest.approx([0, 0, 0.0325])
    assert body.mass.inertia_kg_m2[2, 2] == pytest.approx(0.4 * 0.05 * 0.03**2)
    assert body.mass.inertia_kg_m2[0, 0] == pytest.approx(0.05 * (0.03**2 + 0.0325**2) / 5)
    # the foot reaches from the floor to the circle in which the egg has the foot's radius
    top = foot.position_m[2] + foot.size_m[1]
    assert foot.position_m[2] - foot.size_m[1] == pytest.approx(-0.0325)
    assert 0.03 * np.sqrt(1 - (top / 0.0325) ** 2) == pytest.approx(foot.size_m[0])


def test_a_cylinder_has_a_cylinders_inertia(grasp: Tasks) -> None:
    target = grasp(object="cylinder").target
    assert target.radius_m == pytest.approx(0.016)
    assert target.body.mass.mass_kg == pytest.approx(0.010)
    assert target.body.mass.inertia_kg_m2[0, 0] == pytest.approx(0.01 * (0.016**2 / 4 + 0.035**2 / 12))


def test_weights_hang_where_the_config_says(grasp: Tasks) -> None:
    centred = grasp(extra_weights=5).target.body.mass
    assert centred.mass_kg == pytest.approx(0.150)
    assert centred.com_m == pytest.approx([0, 0, 0])
    low = grasp(extra_weights=5, weights_height="10 mm").target.body.mass
    assert low.com_m[2] == pytest.approx(0.1 * (0.010 - 0.0325) / 0.15)
    reduced = 0.05 * 0.1 / 0.15  # two masses about their common centre
    egg = 0.05 * (0.03**2 + 0.0325**2) / 5
    assert low.inertia_kg_m2[0, 0] == pytest.approx(egg + reduced * 0.0225**2)


def test_a_part_has_its_solid_mass(grasp: Tasks, tmp_path: Path) -> None:
    box = trimesh.creation.box((20.0, 30.0, 40.0))
    box.apply_translation((5.0, -7.0, 100.0))
    box.export(tmp_path / "part.stl")
    target = grasp(object={"mesh": tmp_path / "part.stl", "scale": 0.001, "density": 1000}).target
    assert target.body.mass.mass_kg == pytest.approx(0.024)
    assert target.body.mass.inertia_kg_m2[0, 0] == pytest.approx(0.024 * (0.03**2 + 0.04**2) / 12)
    assert target.radius_m == pytest.approx(0.015)
    # on the floor, its outline's centre over the origin
    assert target.body.position_m + target.body.mass.com_m == pytest.approx([0, 0, 0.02])
    assert target.note == ""


def test_a_hollow_part_is_said_to_be_taken_for_its_hull(grasp: Tasks, tmp_path: Path) -> None:
    ring = trimesh.creation.annulus(r_min=0.010, r_max=0.012, height=0.02)
    ring.export(tmp_path / "ring.stl")
    target = grasp(object={"mesh": tmp_path / "ring.stl", "mass": "30 g"}).target
    assert target.body.mass.mass_kg == pytest.approx(0.030)
    assert "hull" in target.note
    excess = float(target.note.split("encloses ")[1].split(" %")[0])
    assert excess == pytest.approx(100 * (12**2 / (12**2 - 10**2) - 1), abs=2)


CUBE = trimesh.creation.box((0.02, 0.02, 0.02))
FLAT = trimesh.Trimesh([[0, 0, 0], [0.02, 0, 0], [0, 0.02, 0]], [[0, 1, 2], [0, 2, 1]])


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        (
            "part.stl",
            trimesh.Trimesh(CUBE.vertices, CUBE.faces[:-1], process=False),
            "not watertight: 3 edges",
        ),
        ("part.stl", trimesh.Trimesh(CUBE.vertices, CUBE.faces[:, ::-1], process=False), "inside out"),
        ("part.stl", trimesh.creation.box((20.0, 20.0, 65.0)), r"65 m long.*'scale: 0.001'"),
        ("part.stl", b"solid nothing\nendsolid nothing\n", "part.stl"),
        ("part.stl", bytes(range(128, 256)) * 40, "part.stl"),
        ("part.stl", FLAT, "'part.stl' encloses no volume"),
        ("part.dwg", b"AC1015", r"'part.dwg' is none of .stl, .obj, .ply, .off"),
        ("absent.stl", b"", r"no file; did you mean 'absent1.stl'\?"),
    ],
)
def test_parts_that_cannot_be_grasped(
    grasp: Tasks, tmp_path: Path, name: str, content: bytes | trimesh.Trimesh, says: str
) -> None:
    path = tmp_path / name.replace("absent", "absent1")
    if isinstance(content, bytes):
        path.write_bytes(content)
    else:
        content.export(path)
    with pytest.raises(UserError, match=says):
        _ = grasp(object={"mesh": tmp_path / name, "mass": "10 g"}).target


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ({"object": "eg"}, "'eg' is no object; did you mean 'egg'"),
        ({"object": {"shape": "egg", "mesh": "a.stl", "mass": 1}}, "either 'shape'"),
        ({"object": {"mesh": "a.stl"}}, "either 'mass' or 'density'"),
        ({"object": {"shape": "cylinder", "foot_radius": "3 mm"}}, "only an egg"),
        ({"fingers": 0}, "greater than or equal to 1"),
        ({"fingers": True}, "true or false"),
        ({"base_radius": "14 mm", "base_inset": "2 mm"}, "either 'base_radius'"),
        ({"pressure": None}, "exactly one of"),
        ({"noise": {"friction": 1.5}}, "less than 1"),
        ({"pressure": "15 mm"}, "pressure"),
    ],
)
def test_configs_that_are_refused(grasp: Tasks, keys: dict[str, object], says: str) -> None:
    with pytest.raises(ValidationError, match=says):
        grasp(**keys)


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ({"extra_weights": 5, "weight": 20}, r"weighs 100 kg.*write '20 g'"),
        ({"object": {"shape": "egg", "foot_radius": "40 mm"}}, "wider than the egg"),
    ],
)
def test_objects_that_cannot_be(grasp: Tasks, keys: dict[str, object], says: str) -> None:
    with pytest.raises(UserError, match=says):
        _ = grasp(**keys).target
