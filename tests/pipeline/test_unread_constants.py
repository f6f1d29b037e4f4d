"""Constants of family and material on which laws from tables do not depend are refused or named."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest
from tests.pliant_designs import meta_bench

from pliant import api
from pliant.errors import UserError
from pliant.execution.progress import Silent
from pliant_designs.solved_designs import solved_designs
from pliant_designs.stage import unread_by_meta_model

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
STUDY = """pliant: 1
name: s
family: {{kind: bellow_bending, inner_radius: {radius}, average_radius: 6 mm, wall: 1.5 mm, module_length: 11 mm}}
material: {{kind: neo_hookean, shear_modulus: {modulus}, density: 1080 kg/m^3}}
surrogate: {{kind: polynomial, data: {data}}}
chain: {{modules: 4}}
task: {{kind: tip_load, pressure: 5 kPa}}
"""


class HeardNotes(Silent):
    """A progress that keeps its notes."""

    def __init__(self) -> None:
        self.notes: list[str] = []

    def note(self, text: str) -> None:
        self.notes.append(text)


def run(folder: Path, data: Path, radius="2 mm", modulus="249 kPa"):
    path = folder / "s.yaml"
    path.write_text(STUDY.format(radius=radius, modulus=modulus, data=data), encoding="utf-8")
    heard = HeardNotes()
    done = api.simulate(api.open_study(path, store=folder / "store", progress=heard))
    return done, heard.notes


def without_columns(folder: Path, start: str) -> Path:
    """Return the shipped table without the columns that begin with this text."""
    with (EXAMPLES / "data/bellow_bending.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    kept = [name for name in rows[0] if not name.startswith(start)]
    path = folder / "bare.csv"
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, kept, extrasaction="ignore")
        writer.writeheader()
        writer.writerows(rows)
    return path


def test_the_same_module_says_nothing(tmp_path):
    _, notes = run(tmp_path, EXAMPLES / "data/bellow_bending.csv")
    assert not [note for note in notes if "depend" in note]


@pytest.mark.parametrize(
    ("change", "key"),
    [
        ({"modulus": "100 kPa"}, r"material\.shear_modulus is 100 kPa"),
        ({"radius": "2.2 mm"}, r"family\.inner_radius"),
    ],
)
def test_another_module_is_refused(tmp_path, change, key):
    with pytest.raises(UserError, match=key):
        run(tmp_path, EXAMPLES / "data/bellow_bending.csv", **change)


def test_a_table_that_does_not_state_its_rubber_is_named(tmp_path):
    _, notes = run(tmp_path, without_columns(tmp_path, "material."), modulus="100 kPa")
    assert any("does not depend on" in note and "material.shear_modulus" in note for note in notes)


def test_a_meta_model_names_what_its_designs_do_not_state(tmp_path):
    opened = meta_bench.opened(tmp_path)  # its table has radius and length alone
    solved = solved_designs(opened.context, opened.study)
    said = unread_by_meta_model(solved.designs, "fem.csv", opened.study.family, opened.study.material)
    assert "material.shear_modulus" in said and "radius" not in said
