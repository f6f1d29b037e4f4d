"""STL surfaces, written and read: closed, of correct volume and position; a drawn surface changes pictures only."""

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh

from pliant.api import open_study
from pliant.meshing.stl import read_stl, write_stl
from pliant.pipeline.motion import drawn_chain, surface_at_rest
from pliant.pipeline.study import StudyRun, build_study_laws
from pliant.pipeline.visual import side
from pliant.pipeline.workbench import content
from pliant.records.shape import TriangleMesh

STUDY = """\
pliant: 1
name: bellow
family:
  kind: bellow_bending
  inner_radius: 2 mm
  average_radius: 6 mm
  wall: 1.5 mm
  module_length: 11 mm
material: {kind: neo_hookean, shear_modulus: 240 kPa, density: 1150 kg/m^3}
surrogate:
  kind: polynomial
  form: study
  coefficients: {k_n: 1.637e-6, m_a: -1.704e-6, m_e: 0.1012, b_e: 0.0245}
chain: {modules: 3}
"""
OUTER_M = 23e-3  # crests, 2 (2R − r + t)


@pytest.fixture
def study(workplace: Path) -> Path:
    path = workplace / "bellow.yaml"
    path.write_text(STUDY)
    return path


@pytest.fixture
def box(workplace: Path) -> Path:
    """Write a box of a module's length and 4 mm square, in millimetres, and return its file."""
    path = workplace / "box.stl"
    trimesh.creation.box((11, 4, 4)).export(path)
    return path


def drawn(study: Path, *overrides: str) -> TriangleMesh:
    opened = open_study(study, overrides)
    run = StudyRun(opened.study, build_study_laws(opened.context, opened.study))
    return surface_at_rest(drawn_chain(opened.context, run))


def test_the_module_stl_is_closed_and_weighs_what_the_module_weighs(pliant, study):
    answer = pliant(
        "export", "bellow.yaml", "--part", "module", "--out", "module.stl", "--json", "-", "--quiet"
    ).done()
    solid = trimesh.load_mesh("module.stl")
    assert json.loads(answer.out)["triangles"] == len(solid.faces)
    assert solid.is_watertight
    opened = open_study(study)
    mass = opened.context.build("family", opened.study.family).mass(1150.0)
    weight = mass.start.mass_kg + mass.end.mass_kg
    assert 1150 * solid.volume == pytest.approx(weight, rel=0.01)
    np.testing.assert_allclose(solid.extents[0], 11e-3, rtol=1e-5)


def test_the_chain_stl_in_millimetres_hangs_from_the_base(pliant, study):
    assert pliant("export", "bellow.yaml", "--out", "chain.stl", "--scale", "1000").code == 0
    solid = trimesh.load_mesh("chain.stl")
    # three modules and a cap of two walls below the base, the flange of 6 mm above it
    np.testing.assert_allclose(solid.bounds[:, 2], [-33 - 3, 6], atol=0.03)
    assert solid.is_watertight and solid.volume > 0


@pytest.mark.parametrize("kind", ["stl", "stl_ascii"])
def test_a_drawn_surface_replaces_the_family_s(study, box, kind):
    trimesh.load_mesh(box).export(box, file_type=kind)
    seen = drawn(study, "family.visual=box.stl", "family.visual_scale=0.001")
    assert np.ptp(seen.vertices_m[:, 1]) == pytest.approx(4e-3)
    assert np.ptp(drawn(study).vertices_m[:, 1]) == pytest.approx(OUTER_M, rel=0.01)
    assert np.ptp(seen.vertices_m[:, 2]) == pytest.approx(33e-3)


def test_a_drawn_surface_is_in_no_key_and_no_data(study, box):
    plain = open_study(study).study.family
    seen = open_study(study, ["family.visual=box.stl", "family.visual_scale=0.001"]).study.family
    assert seen.visual == box.resolve()
    assert content(seen) == content(plain)


def test_the_path_is_relative_to_the_study(workplace, study, box):
    folder = workplace / "deeper"
    folder.mkdir()
    box.rename(folder / "box.stl")
    (folder / "study.yaml").write_text(
        "extends: ../bellow.yaml\nfamily: {visual: box.stl, visual_scale: 0.001}\n"
    )
    assert np.ptp(drawn(folder / "study.yaml").vertices_m[:, 1]) == pytest.approx(4e-3)


def test_cut_at_the_joint_and_put_together_it_is_the_same_surface():
    sphere = trimesh.creation.icosphere(subdivisions=2)
    surface = TriangleMesh(np.array(sphere.vertices) + [0.3, 0, 0], np.array(sphere.faces))
    start, end = side(surface, -1.0), side(surface, 1.0)
    assert start.vertices_m[:, 0].max() == 0.0 == end.vertices_m[:, 0].min()
    area = sum(trimesh.Trimesh(s.vertices_m, s.faces).area for s in (start, end))
    assert area == pytest.approx(sphere.area, rel=1e-12)
    whole = start.joined(end)
    assert trimesh.Trimesh(whole.vertices_m, whole.faces).is_watertight


def test_written_and_read_it_is_the_same(tmp_path):
    sphere = trimesh.creation.icosphere(subdivisions=1)
    write_stl(TriangleMesh(1e-3 * np.array(sphere.vertices), np.array(sphere.faces)), tmp_path / "s.stl", 1e3)
    again = read_stl(tmp_path / "s.stl", 1e-3)
    assert len(again.faces) == len(sphere.faces)
    assert trimesh.Trimesh(again.vertices_m, again.faces).volume == pytest.approx(
        1e-9 * sphere.volume, rel=1e-5
    )


@pytest.mark.parametrize(
    ("visual", "told"),
    [
        ("boks.stl", "is no file; did you mean 'box.stl'?"),
        ("bellow.yaml", "no STL file"),
        ("empty.stl", "no triangles"),
        ("box.stl", "visual_scale: 0.001"),
    ],
)
def test_a_wrong_file_is_told_before_anything_runs(pliant, workplace, study, box, visual, told):
    (workplace / "empty.stl").write_text("solid nothing\nendsolid nothing\n")
    pliant("export", "bellow.yaml", f"family.visual={visual}", "--out", "c.stl").refused(told)
    assert not Path("c.stl").exists()


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("--part", "leg", "--out", "a.stl"), "neither 'chain' nor 'module'"),
        (("--scale", "0", "--out", "a.stl"), "no scale"),
        (("--part", "module", "--out", "a.urdf"), "for 3MF, STL and STEP"),
        (("--out", "a.dwg"), "stl"),
    ],
)
def test_wrong_words(pliant, study, words, told):
    pliant("export", "bellow.yaml", *words).refused(told)
