"""Describe a robot by a form: installed kinds appear with their fields and give the study that a user would write."""

from __future__ import annotations

import json
import re
import threading
import time
from pathlib import Path
from typing import Any

import pytest

from pliant.config.loading import load_study
from pliant.errors import UserError
from pliant.registry.discovery import discover
from pliant_app.controller import SessionController
from pliant_app.describing import described, form
from pliant_app.folder import SessionFolder
from pliant_plugins.families.reference import FINGER

from .conftest import STUDY, recording

LAW = {"k_n": "1.637e-6", "m_a": "-1.704e-6", "m_e": "0.1012", "b_e": "0.0245"}
CHAIN = {"modules": "1", "module_length": "80 mm", "module_mass": "40 g"}


def ways() -> dict[str, dict]:
    return {one["way"]: one["blocks"] for one in form(discover())["ways"]}


def test_every_installed_family_and_material_appears_with_its_fields() -> None:
    registry = discover()
    families = {one["kind"]: one["fields"] for one in ways()["family"]["family"]}
    assert {"bellow_bending", "pneunet", "three_chamber"} <= set(families)
    assert "mesh_file" not in families  # a form cannot supply the file that this kind needs
    for kind, fields in families.items():
        model = registry.get("family", kind).config_model()
        required = {name for name, info in model.model_fields.items() if info.is_required()}
        assert len([one for one in fields if one["required"]]) == len(required)
    wall = next(one for one in families["bellow_bending"] if one["name"] == "wall")
    assert wall["unit"] == "mm" and wall["required"] and "wall" in wall["words"]
    density = next(
        field
        for one in ways()["family"]["material"]
        if one["kind"] == "neo_hookean"
        for field in one["fields"]
        if field["name"] == "density"
    )
    assert density["default"] == "1150 kg/m³" and not density["required"]


def test_a_described_family_is_the_study_that_one_would_write(tmp_path: Path) -> None:
    text = described(
        {
            "way": "family",
            "name": "../a robot!",
            "weight": False,
            "family": {"kind": "bellow_bending", **FINGER},
            "material": {"kind": "neo_hookean", "shear_modulus": "240 kPa", "density": ""},
            "fem": {"pressure_max": "15 kPa", "tendon_force_max": ""},
            "chain": {"modules": "8"},
        },
        [],
    )
    file = tmp_path / "a.yaml"
    file.write_text(text)
    study = load_study(file, discover())
    assert study.family.wall_m == 1.5e-3 and study.material.shear_modulus_pa == 240e3
    assert study.fem.pressure_max_pa == 15e3 and study.chain.modules == 8
    assert study.chain.gravity_m_s2 == (0.0, 0.0, 0.0)


def test_a_stated_law_opens_the_model_that_its_study_opens(bench: Path) -> None:
    made = SessionController(SessionFolder(bench / "session"), bench / "store")
    (made.folder.files / "bench.csv").write_text(recording())
    made.take("bench.csv")
    made.describe({"way": "law", "name": "bend", "weight": False, "surrogate": LAW, "chain": CHAIN})
    made.runner.wait()
    assert made.state.pending is None and not made.said
    by_hand = SessionController(SessionFolder(bench / "other"), bench / "store")
    by_hand.begin(bench / "bend.yaml", [])
    ours, theirs = (one.view()["model"]["steps"][0] for one in (made, by_hand))
    assert ours["error"] == pytest.approx(theirs["error"], rel=1e-12)
    assert "task:" in STUDY  # a comparison does not need this block


def test_states_that_are_being_solved_are_counted_and_can_be_stopped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun, solved = threading.Event(), []

    def solve(bench: Any, study: Any) -> None:
        bar = bench.progress.begin("FEM states", 20)
        for _ in range(1000):
            solved.append(1)
            bar.advance()
            begun.set()
            time.sleep(0.01)

    monkeypatch.setattr("pliant_app.controller.build_study_chain", solve)
    controller = SessionController(SessionFolder(tmp_path / "session"), tmp_path / "store")
    controller.describe({"way": "law", "name": "bend", "weight": False, "surrogate": LAW, "chain": CHAIN})
    assert begun.wait(20)
    assert re.match(r"FEM states: \d+ of about \d+", controller.status()["job"]["words"])
    controller.stop()
    controller.runner.wait()
    assert len(solved) < 1000 and controller.state.pending is None and not controller.state.study
    assert "stopped; what was solved is kept" in controller.said[-1]


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({"way": "magic"}, "described by one of"),
        ({"way": "data", "table": "../x.csv"}, "drop the table"),
        ({"way": "law", "surrogate": {**LAW, "b_e": "zzz"}, "chain": CHAIN}, "b_e"),
        ({"way": "law", "surrogate": {**LAW, "x" * 50: "1"}, "chain": CHAIN}, "x" * 20),
        ({"way": "law", "surrogate": LAW, "chain": {**CHAIN, "modules": "1" * 300}}, "longer than"),
        ({"way": "law", "surrogate": LAW, "chain": [1]}, "names and texts"),
    ],
)
def test_what_cannot_be_is_said_and_leaves_no_file(tmp_path: Path, values: dict, says: str) -> None:
    controller = SessionController(SessionFolder(tmp_path / "session"), tmp_path / "store")
    with pytest.raises(UserError, match=says) as refused:
        controller.describe(values)
    assert str(controller.folder.path) not in str(refused.value)
    assert not list(controller.folder.files.iterdir()) and not controller.state.study


def test_form_texts_stay_texts() -> None:
    text = described({"way": "law", "surrogate": {"k_n": "1}\nplugins: [evil.py]"}, "chain": CHAIN}, [])
    assert [line for line in text.splitlines() if line.startswith("plugins")] == []
    assert json.loads(next(x for x in text.splitlines() if x.startswith("surrogate")).split(": ", 1)[1])
