"""Solids of all families: closed, of the FEM's volume and walls, with the cavities and the mass of the modules."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from benchmarks.print.designs import DESIGNS, study_text
from tests.slow import slow_among

from pliant.api import open_study
from pliant.errors import NotReachedError
from pliant.meshing.surfaces import mirrored
from pliant.records.shape import TriangleMesh
from pliant_print import solids
from pliant_print.boolean import cylinder, solid, surface, united
from pliant_print.chain_solid import chain_solid
from pliant_print.checks import check_surface, crossings
from pliant_print.closing import closed_chain, modules_volume_m3
from pliant_print.config import SolidConfig
from pliant_print.loops import Loop, deepest_point, merged, prism
from pliant_print.module_solid import module_solid
from pliant_print.solids import PrintedSolid, printed_chain, printed_module
from pliant_print.stack import study_pieces
from pliant_print.walls import overhang, thinnest_wall

FAMILIES = slow_among(DESIGNS, "bellow_helical", "bellow_translational", "bellow_bending")


def opened(folder: Path, text: str) -> Any:
    path = folder / "study.yaml"
    path.write_text(text)
    return open_study(path, store=folder / "store")


def printed(folder: Path, text: str) -> PrintedSolid:
    one = opened(folder, text)
    return printed_chain(one.context, one.study)


@pytest.mark.parametrize("name", FAMILIES)
def test_a_robot_is_closed_and_has_the_volume_and_the_walls_that_were_solved(tmp_path, name):
    made = printed(tmp_path, study_text(name, modules=2))
    for body in made.bodies:
        whole = trimesh.Trimesh(body.surface.vertices_m, body.surface.faces, process=False)
        assert whole.is_watertight and whole.is_winding_consistent and body.check.crossings == 0
        assert whole.volume == pytest.approx(body.check.volume_m3, rel=1e-9) and whole.volume > 0
    assert abs(made.volume_error) < 5e-3
    for material, wall in DESIGNS[name].walls_m.items():
        assert made.module_walls[material].thickness_m == pytest.approx(wall, rel=0.01)


@pytest.mark.parametrize(
    "name", slow_among(DESIGNS, "bellow_helical", "bellow_translational", "bellow_bending")
)
def test_a_module_weighs_what_the_chain_s_module_weighs(tmp_path, name):
    one = opened(tmp_path, study_text(name))
    made = printed_module(one.context, one.study)
    family = one.context.build("family", one.study.family)
    region = DESIGNS[name].region
    mass = family.mass(1150.0, {region: 1300.0}) if region else family.mass(1150.0)
    expected = mass.start.mass_kg + mass.end.mass_kg - 1150.0 * family.unmeshed_volume_m3
    assert sum(body.mass_kg for body in made.bodies) == pytest.approx(expected, rel=5e-3)


def test_the_cavity_is_closed_but_for_its_inlet_and_holds_the_design_s_volume(tmp_path):
    one = opened(tmp_path, study_text("bellow_bending", modules=2))
    chain = chain_solid(study_pieces(one.context, one.study))
    closed = closed_chain(chain, SolidConfig(), 1.5e-3)
    body = closed.bodies["body"]
    family = one.context.build("family", one.study.family)
    inlet = closed.inlets[0]
    plug = SolidConfig().flange_m
    low, high = (np.array([x, *inlet.point_m]) for x in (-plug, -plug / 2))
    plugged = united([body, cylinder(low, high, 2.2e-3)])
    hollows = [piece for piece in plugged.decompose() if piece.volume() < 0]
    assert len(hollows) == 1
    cavity = -1e-9 * hollows[0].volume() - np.pi * inlet.radius_m**2 * plug / 3
    assert cavity == pytest.approx(2 * family.geometry.cavity_volume(), rel=0.02)


def test_each_chamber_has_an_inlet_and_the_bore_stays_open(tmp_path):
    one = opened(tmp_path, study_text("three_chamber", modules=1))
    closed = closed_chain(chain_solid(study_pieces(one.context, one.study)), SolidConfig(), 1.5e-3)
    assert sorted(inlet.name for inlet in closed.inlets) == [f"pressure_{k}_pa" for k in (1, 2, 3)]
    assert closed.bodies["body"].genus() == SolidConfig().screws + 1  # screw holes and the bore


TURNED = """\
chain:
  segments:
    - {modules: 1}
    - {modules: 1, rotation: 90 deg}
    - {rigid: {length: 3 mm, section: module}}
"""


def chambers(*numbers: int) -> str:
    return ", ".join(f"{{input: pressure_{k}_pa}}" for k in numbers)


@pytest.mark.parametrize("rigid", [True, False])
def test_segments_with_inputs_of_their_own_are_closed_toward_each_other(tmp_path, rigid):
    block = "    - {rigid: {length: 6 mm}}\n" if rigid else ""

    def closed(*second: int):
        segments = f"    - {{modules: 1, actuators: [{chambers(1, 2, 3)}]}}\n{block}"
        segments += f"    - {{modules: 1, actuators: [{chambers(*second)}]}}\n"
        text = study_text("three_chamber").replace(
            "chain: {modules: 3}\n", f"chain:\n  segments:\n{segments}"
        )
        (tmp_path / "study.yaml").unlink(missing_ok=True)
        one = opened(tmp_path, text)
        config = SolidConfig(inlet_bore_m=1.5e-3)
        return closed_chain(chain_solid(study_pieces(one.context, one.study), 1.5e-3), config, 1.5e-3)

    own, shared = closed(4, 5, 6), closed(1, 2, 3)
    assert len(own.chain.supplies) == 3 and not shared.chain.supplies
    assert sum("from the bore" in note for note in own.notes) == 1
    for made in (own, shared):
        assert modules_volume_m3(made) == pytest.approx(sum(made.chain.fem_volumes_m3.values()), rel=5e-3)
        assert check_surface(surface(made.bodies["body"])).sound
        # Screw holes and the bore; each chamber is a pocket with one opening. Were both joined, it would be a passage.
        assert made.bodies["body"].genus() == SolidConfig().screws + 1


def test_turned_segments_are_joined_by_a_plate_with_a_duct(tmp_path):
    text = study_text("bellow_bending").replace("chain: {modules: 3}\n", TURNED)
    one = opened(tmp_path, text)
    closed = closed_chain(chain_solid(study_pieces(one.context, one.study)), SolidConfig(), 1.5e-3)
    fem = sum(closed.chain.fem_volumes_m3.values())
    assert modules_volume_m3(closed) == pytest.approx(fem, rel=5e-3)
    assert any("plate" in note for note in closed.notes)
    pieces = closed.bodies["body"].decompose()
    assert [piece.volume() > 0 for piece in pieces] == [True]  # one body, and no chamber is shut off
    assert np.ptp(surface(closed.bodies["body"]).vertices_m[:, 0]) == pytest.approx(31e-3, rel=1e-6)


def test_a_band_of_the_fem_is_a_body_with_the_modulus_that_it_needs(tmp_path):
    one = opened(tmp_path, study_text("bellow_helical", modules=1))
    closed = closed_chain(chain_solid(study_pieces(one.context, one.study)), SolidConfig(), 1.5e-3)
    assert list(closed.bodies) == ["body", "ribbon"]
    modulus = 60.0 / (1.8161e-3 * 0.4e-3) / 1e6
    assert any(f"E = {modulus:.3g} MPa" in note for note in closed.notes)


def test_the_tendon_s_hole_goes_through_every_link(tmp_path):
    made = printed(tmp_path, study_text("tendon_joint", modules=2))
    links = next(body for body in made.bodies if body.name == "links")
    whole = solid(links.surface)
    z = -4.0
    assert not whole.ray_cast((-20.0, 0.0, z), (80.0, 0.0, z))
    assert whole.ray_cast((-20.0, 0.0, z - 1), (80.0, 0.0, z - 1))


def cube(low: float = 0.0, size: float = 1.0) -> TriangleMesh:
    box = trimesh.creation.box((size, size, size))
    return TriangleMesh(np.array(box.vertices) + low, np.array(box.faces, np.int64))


def test_the_check_counts_crossings_and_open_edges():
    assert check_surface(cube()).sound
    assert crossings(cube().joined(cube(0.3))) > 0
    assert crossings(cube().joined(cube(1.5))) == 0
    assert check_surface(TriangleMesh(cube().vertices_m, cube().faces[1:])).open_edges == 3
    assert not check_surface(TriangleMesh(cube().vertices_m, cube().faces[:, ::-1])).sound


@pytest.mark.parametrize("wall", [0.7e-3, 2e-3])
def test_the_thinnest_wall_is_that_of_a_box_with_a_box_in_it(wall):
    size = 10e-3
    outer, inner = (solid(cube(0.0, one)) for one in (size, size - 2.2 * wall))
    hollow = outer - inner.translate((100 * wall, 0.0, 0.0))
    assert thinnest_wall(hollow).thickness_m == pytest.approx(wall, rel=1e-6)


def test_overhang_of_a_cone_begins_at_its_angle():
    cone = trimesh.creation.cone(radius=1.0, height=1.0)
    skin = TriangleMesh(np.array(cone.vertices), np.array(cone.faces, np.int64))
    down, up = np.array([0.0, 0.0, -1.0]), np.array([0.0, 0.0, 1.0])
    assert overhang(skin, up, "z", np.radians(30)).share == 0.0
    assert overhang(skin, down, "-z", np.radians(40)).share > 0.5
    assert overhang(skin, down, "-z", np.radians(50)).share < 0.5  # its bottom alone, now on top


def test_the_deepest_point_of_an_l_lies_in_its_knee():
    corners = np.array([[0, 0], [4, 0], [4, 1], [1, 1], [1, 4], [0, 4]], float)
    point, reach = deepest_point(Loop(np.arange(6), corners))
    assert 0.5 < reach < 0.6 and point.max() < 1.0
    column = solid(prism([Loop(np.arange(6), 1e-3 * corners)], 0.0, 2e-3))
    assert column.volume() == pytest.approx(14.0, rel=1e-6)


def test_merging_keeps_a_surface_that_is_closed_already():
    assert len(merged(cube()).faces) == 12
    image = mirrored(cube(), 0)
    beside = TriangleMesh(image.vertices_m + [1.0, 0, 0], image.faces)
    assert len(merged(cube().joined(beside)).faces) == 20  # the faces between them are gone


def test_a_law_without_a_family_is_refused(pliant, workplace):
    Path("stated.yaml").write_text(
        "pliant: 1\nname: stated\nsurrogate: {kind: polynomial, form: study, coefficients: {k_n: 1e-6, m_a: 0, b_a: 0, "
        "m_e: 0, b_e: 0.02}}\nchain: {modules: 2, module_length: 10 mm, gravity: [0, 0, 0]}\n"
    )
    pliant("export", "stated.yaml", "--out", "a.3mf").refused("has no 'family' block")


def test_a_family_with_its_volume_wrong_is_not_written(tmp_path, monkeypatch):
    one = opened(tmp_path, study_text("two_chamber", modules=1))
    real = solids.modules_volume_m3
    monkeypatch.setattr(solids, "modules_volume_m3", lambda closed: 1.01 * real(closed))
    with pytest.raises(NotReachedError, match="FEM's mesh"):
        printed_chain(one.context, one.study)


def test_surface_of_a_module_is_the_mesh_s(tmp_path):
    one = opened(tmp_path, study_text("pneunet"))
    module = module_solid(one.context.build("family", one.study.family))
    assert surface(solid(module.bodies["layer"])).vertices_m[:, 2].max() == pytest.approx(0.5e-3)
