"""`pliant fem --fields`: files for ParaView, a page next to the table, and refused input."""

import csv
import sys
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from pliant.interfaces.fem import ModuleSolver
from pliant.meshing.hexahedra import cell_volumes
from pliant_view.vtu import VTK_ORDER

meshio = pytest.importorskip("meshio", reason="the extra pliant[fields]")
JOINT = """\
pliant: 1
name: joint
family:
  kind: tendon_joint
  module_length: 28 mm
  flexure_length: 5 mm
  flexure_thickness: 1 mm
  flexure_width: 20 mm
  tendon_offset: 6.6 mm
  tendon_setback: 11.15 mm
  link_height: 18 mm
  link_width: 20 mm
  link_density: 1290 kg/m^3
  closing_angle: 0.92 rad
  opening_angle: 0.02 rad
material: {kind: neo_hookean, shear_modulus: 72 MPa}
fem: {kind: skfem, tendon_force_max: 4 N, pressures: 2, angles: 3, check_states: 1}
"""
HALF = 0.0025  # half the flexure's length


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    """Return one store for all tests of this file, so that the data set is solved once."""
    return tmp_path_factory.mktemp("store")


def states(folder):
    with (folder / "states.csv").open(newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.slow
def test_files_hold_the_mesh_and_what_the_joint_does(pliant, write, read, workplace, store):
    pliant("fem", write(JOINT), "--store", store, "--fields", "vtu", "--json", "out.json").done()
    folder, rows = workplace / "vtu", states(workplace / "vtu")
    assert {r["branch"] for r in rows} == {"free", "constrained"}
    written = {p.name for p in folder.iterdir()}
    assert written == {*(r["file"] for r in rows), "free.pvd", "held.pvd", "states.csv"}
    assert {p.rpartition("/")[2] for p in read("out.json")["fields"]} == written
    times = [float(s.get("timestep")) for s in ET.parse(folder / "free.pvd").iter("DataSet")]
    assert times == [0.0, 4.0]
    for row in rows:
        mesh = meshio.read(folder / row["file"])
        cells = mesh.cells[0].data[:, np.argsort(VTK_ORDER)]
        assert cell_volumes(mesh.points, cells).sum() == pytest.approx(HALF * 1e-3 * 10e-3, rel=1e-9)
        end = np.abs(mesh.points[:, 0] - HALF) < 1e-9
        before, after = mesh.points[end], (mesh.points + mesh.point_data["displacement_m"])[end]
        # bonded to a rigid link, the end section turns by half the joint's angle about y
        half = float(row["angle_rad"]) / 2
        turn = np.array([[np.cos(half), 0, np.sin(half)], [0, 1, 0], [-np.sin(half), 0, np.cos(half)]])
        np.testing.assert_allclose(after - after[0], (before - before[0]) @ turn.T, atol=1e-10)
        assert {"von_mises_pa", "hydrostatic_pa", "largest_stretch"} <= set(mesh.point_data)
    free = meshio.read(folder / "free_001.vtu")
    assert free.point_data["von_mises_pa"].max() > 1e6
    assert meshio.read(folder / "free_000.vtu").point_data["von_mises_pa"].max() < 1.0


@pytest.mark.slow
def test_which_states_are_written(pliant, write, workplace, store):
    study = write(JOINT)
    table = workplace / "runs" / "joint" / "fem.csv"
    assert pliant("fem", study, "--store", store, "--fields", "free", "--fields-of", "free").code == 0
    assert [r["branch"] for r in states(workplace / "free")] == ["free", "free"]
    assert pliant("fem", study, "--store", store, "--fields", "all", "--fields-of", "all").code == 0
    with table.open(newline="") as file:
        solved = list(csv.DictReader(file))
    found = states(workplace / "all")
    assert len(found) == len(solved)
    for row in solved:
        p, u, tau = (float(row[name]) for name in ("tendon_force_n", "angle_rad", "moment_n_m"))
        again = min(
            found, key=lambda f: abs(float(f["tendon_force_n"]) / 4 - p / 4) + abs(float(f["angle_rad"]) - u)
        )
        assert float(again["angle_rad"]) == pytest.approx(u, abs=1e-7)
        assert float(again["moment_n_m"]) == pytest.approx(tau, abs=1e-7)


@pytest.mark.slow
def test_the_page_lies_beside_the_table(pliant, write, read, workplace, store):
    call = pliant("fem", write(JOINT), "--store", store, "--json", "out.json")
    page = workplace / "runs" / "joint" / "fem.html"
    assert read("out.json")["report"] == str(page.relative_to(workplace))
    text = page.read_text()
    assert "The free module bends" in text
    assert "Von Mises stress" in text
    assert "Newton steps for a state" in call.out
    assert not (workplace / "runs" / "joint" / "report.html").exists()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--fields", "taken"], "cannot be written"),
        (["--fields", "vtu", "--fields-of", "fre"], "give extremes, free or all"),
        (["--fields-of", "all"], "give --fields DIR, too"),
    ],
)
def test_wrong_options_are_refused_before_any_work(pliant, write, workplace, options, said):
    (workplace / "taken").write_text("a file")
    pliant("fem", write(JOINT), *options).refused(said)
    assert not (workplace / ".pliant").exists()


def test_a_sweep_has_no_fields(pliant, write, workplace):
    swept = JOINT + "sweep: {flexure_width: [18 mm, 20 mm]}\n"
    pliant("fem", write(swept), "--fields", "vtu").refused("--fields is for one design")


def test_without_meshio_the_extra_is_named(pliant, write, monkeypatch):
    monkeypatch.setitem(sys.modules, "meshio", None)
    pliant("fem", write(JOINT), "--fields", "vtu").refused("pip install 'pliant[fields]'")


@pytest.mark.slow
def test_a_backend_without_fields_says_so(pliant, write, store, monkeypatch):
    study = write(JOINT)
    assert pliant("fem", study, "--store", store).code == 0
    from pliant_plugins.fem.skfem.backend import SkfemSolver

    monkeypatch.setattr(SkfemSolver, "fields", ModuleSolver.fields)
    pliant("fem", study, "--store", store, "--fields", "vtu").refused("gives no fields")
