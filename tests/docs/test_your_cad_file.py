"""docs/your_cad_file.md is correct: its script is the example's, its mesh is solved, its sentences are printed."""

import re
import runpy
import shutil
import sys
from pathlib import Path

import pytest
from tests.docs.pages import ROOT, blocks, page_text, run

from pliant.config.loading import load_study
from pliant.errors import UserError
from pliant.registry.discovery import discover
from pliant_plugins.families.mesh_file.family import MeshFile

PAGE = page_text("your_cad_file")
CODE = blocks(PAGE, "python")[0]
STUDY = blocks(PAGE, "yaml")[0]


def plain(text: str) -> str:
    return " ".join(re.sub("^> ?", "", text, flags=re.M).split())


def meshed(folder: Path, monkeypatch: pytest.MonkeyPatch, change: tuple[str, str] = ("", "")) -> MeshFile:
    """Return the page's mesh, made by the example's script, as the page's study reads it."""
    pytest.importorskip("netgen.occ", reason="the extra pliant[ngsolve]")
    script = folder / "mesh.py"
    script.write_text((ROOT / "examples/cad_file/mesh.py").read_text("utf-8").replace(*change))
    monkeypatch.setattr(sys, "argv", [str(script)])
    runpy.run_path(str(script), run_name="__main__")
    (folder / "finger.yaml").write_text(STUDY)
    study = load_study(folder / "finger.yaml", discover())
    return MeshFile(study.family)


def test_the_page_shows_the_example() -> None:
    script, example = (
        (ROOT / "examples/cad_file" / name).read_text("utf-8") for name in ("mesh.py", "finger.yaml")
    )
    function = CODE[CODE.index("def surface") : CODE.index("\nmesh_cad(")].strip()
    assert function in script
    assert STUDY.split("\n", 1)[1] in example
    assert re.search(r"largest=[\d.]+", CODE)[0] in script


def test_the_mesh_on_the_page_is_a_module(tmp_path, monkeypatch) -> None:
    family = meshed(tmp_path, monkeypatch)
    assert family.module_length_m == pytest.approx(12e-3)
    # half a cell, half its width, twice: the box, the block between cells, less chamber and channel
    half_kg = 2 * 1e3 * (5 * 8 * 14 + 1 * 8 * 6 - 3.5 * 6.5 * 10.5 - 2.5 * 2 * 2) * 1e-9
    assert family.mass(1e3).end.mass_kg == pytest.approx(half_kg, rel=1e-9)


@pytest.mark.slow
def test_a_forgotten_floor_and_a_forgotten_unit_are_said(tmp_path, monkeypatch) -> None:
    with pytest.raises(UserError) as leak:
        meshed(tmp_path, monkeypatch, (" or floor", "")).problem()
    # the number and the first position are chosen by Netgen
    words, places = (re.sub(r"[\d.]+", "#", text) for text in str(leak.value).split(" the first at "))
    assert words in re.sub(r"[\d.]+", "#", plain(PAGE))
    assert re.search(r", 2\)", str(leak.value)), places
    family = meshed(tmp_path, monkeypatch)
    with pytest.raises(UserError) as unit:
        MeshFile(family.config.model_copy(update={"unit": "m"})).problem()
    assert str(unit.value) in plain(PAGE)


@pytest.mark.slow
def test_the_commands_on_the_page_run(workplace, monkeypatch) -> None:
    """The commands run on a copy of the example, with fewer states than in the page's study."""
    pytest.importorskip("netgen.occ", reason="the extra pliant[ngsolve]")
    folder = workplace / "cad"
    folder.mkdir()
    for name in ("mesh.py", "finger.yaml"):
        shutil.copy(ROOT / "examples/cad_file" / name, folder / name)
    monkeypatch.setattr(sys, "argv", [str(folder / "mesh.py")])
    runpy.run_path(str(folder / "mesh.py"), run_name="__main__")
    said = run("run cad/finger.yaml fem.sampling=grid fem.pressures=3 fem.angles=4 fem.check_states=2")
    assert "6-module finger bends" in said
