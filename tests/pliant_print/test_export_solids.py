"""`pliant export` of solids: files that other programs read, sentences, JSON, and what is refused."""

from __future__ import annotations

import csv
import json
import re
import zipfile
from pathlib import Path

import numpy as np
import pytest
import trimesh
from benchmarks.print.designs import study_text


@pytest.fixture
def pneunet(workplace: Path) -> Path:
    Path("pneunet.yaml").write_text(study_text("pneunet", modules=2) + "printer: {min_wall: 1.6 mm}\n")
    return Path("pneunet.yaml")


def objects_of(path: Path) -> dict[str, trimesh.Trimesh]:
    """Return the bodies of a 3MF file, in mm, by name."""
    text = zipfile.ZipFile(path).read("3D/3dmodel.model").decode()
    found = {}
    for name, mesh in re.findall(
        r'<object id="\d+" type="model" name="([^"]+)"[^>]*>(<mesh>.*?</mesh>)', text
    ):
        points = [
            [float(x) for x in one] for one in re.findall(r'<vertex x="(.*?)" y="(.*?)" z="(.*?)"', mesh)
        ]
        faces = [[int(k) for k in one] for one in re.findall(r'v1="(\d+)" v2="(\d+)" v3="(\d+)"', mesh)]
        found[name] = trimesh.Trimesh(points, faces, process=False)
    return found


def test_a_3mf_file_has_one_object_per_material_upright_on_the_bed(pliant, pneunet):
    answer = pliant("export", pneunet, "--out", "robot.3mf", "--json", "robot.json").done()
    assert "closed, oriented, without triangles that cross" in answer.out
    assert "is thinner than the printer's least wall of 1.6 mm" in " ".join(answer.out.split())
    bodies = objects_of(Path("robot.3mf"))
    assert list(bodies) == ["body", "layer"] and all(one.is_watertight for one in bodies.values())
    low = min(one.bounds[0, 2] for one in bodies.values())
    assert low == pytest.approx(0.0, abs=1e-6)
    assert bodies["layer"].volume == pytest.approx(20 * 15 * 1, rel=1e-6)
    told = json.loads(Path("robot.json").read_text())
    assert [one["name"] for one in told["bodies"]] == ["body", "layer"]
    assert told["thinnest_wall_m"] < told["min_wall_m"] == 1.6e-3
    assert abs(told["modules_volume_m3"] / told["fem_volume_m3"] - 1) < 5e-3


def test_the_same_study_gives_the_same_file(pliant, pneunet):
    for name in ("a.3mf", "b.3mf"):
        pliant("export", pneunet, "--out", name).done()
    assert Path("a.3mf").read_bytes() == Path("b.3mf").read_bytes()


def test_the_bill_weighs_each_material_and_states_test_pressures(pliant, pneunet):
    pliant("export", pneunet, "--out", "robot.3mf").done()
    rows = list(csv.DictReader(Path("robot.bill.csv").read_text().splitlines()))
    layer = next(row for row in rows if row["material"] == "layer")
    assert float(layer["mass_g"]) == pytest.approx(1.3e-3 * 300, rel=1e-4)
    assert [float(row["pressure_kpa"]) for row in rows if row["item"] == "test"] == [3.75, 7.5, 11.25, 15.0]


def test_stl_files_of_several_materials_lie_in_the_same_place(pliant, pneunet):
    answer = pliant("export", pneunet, "--out", "robot.stl", "--scale", "1000").done()
    assert "each material has its own" in answer.out
    body, layer = (trimesh.load_mesh(f"robot-{name}.stl") for name in ("body", "layer"))
    assert body.is_watertight and layer.is_watertight
    np.testing.assert_allclose(layer.bounds[:, 2], [-20, 0], atol=1e-5)  # hanging from the base


def test_a_cad_program_reads_the_step_file(pliant, pneunet):
    occ = pytest.importorskip("netgen.occ")
    answer = pliant("export", pneunet, "--out", "robot.step", "--json", "robot.json").done()
    assert "faceted" in answer.out
    told = {one["name"]: one["volume_m3"] for one in json.loads(Path("robot.json").read_text())["bodies"]}
    solids = occ.OCCGeometry("robot.step").shape.solids
    assert sorted(one.mass for one in solids) == pytest.approx(
        sorted(1e9 * volume for volume in told.values()), rel=1e-4
    )


def test_the_mould_s_files_are_closed_and_the_bill_tells_what_to_mix(pliant, pneunet):
    pliant("export", pneunet, "--mould", "--out", "mould", "--json", "mould.json").done()
    told = json.loads(Path("mould.json").read_text())
    assert told["recovered_volume_m3"] == pytest.approx(told["part_volume_m3"], rel=5e-3)
    names = ["half_1", "half_2", "core_1", "insert_layer", "flange", "part"]
    for name in names:
        (one,) = objects_of(Path(f"mould/{name}.3mf")).values()
        assert one.is_watertight and one.volume > 0
    mix = next(row for row in told["bill"] if row["item"] == "mix")
    assert mix["volume_m3"] == pytest.approx(1.15 * told["poured_volume_m3"])


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("--out", "a.3mf", "--scale", "1000"), "--scale is for STL"),
        (("--out", "a.3mf", "--part", "leg"), "neither 'chain' nor 'module'"),
        (("--mould", "--out", "a", "--format", "stl"), "--mould writes a folder"),
        (("--mould", "--out", "pneunet.yaml"), "a mould is a folder"),
        (("--protocol", "--out", "a.urdf"), "--protocol is for solids"),
        (("--out", "a.3mf", "printer.nozzle=-1 mm"), "nozzle"),
    ],
)
def test_wrong_words(pliant, pneunet, words, told):
    pliant("export", pneunet, *words).refused(told)
    assert not Path("a").exists() and not Path("a.3mf").exists()


@pytest.mark.slow
def test_the_protocol_of_the_first_run_lies_beside_the_file(pliant, workplace):
    law = (
        "{kind: polynomial, form: study, coefficients: {k_n: 2e-6, m_a: 0, b_a: 0, m_e: 0, b_e: 0.04}, "
        "domain: {actuation: [0, 20000], deformation: [-2, 2]}}"
    )
    text = study_text("fibre_reinforced", modules=1).split("material:")[0]
    Path("tube.yaml").write_text(
        f"{text}surrogate: {law}\nchain: {{modules: 1, gravity: [0, 0, 0]}}\n"
        "task: {kind: free_bending, pressure: 10 kPa, steps: 1}\n"
    )
    pliant("export", "tube.yaml", "--out", "tube.3mf", "--protocol").done()
    assert len(list(Path().glob("run_1_*.csv"))) == 1
