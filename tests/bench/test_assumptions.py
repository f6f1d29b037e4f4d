"""What an experiment says about gravity and orientation before anything moves."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.bench.joint_study import STUDY
from tests.command import called

from pliant import api
from pliant_bench.loop.assumptions import assumptions, direction


def said(folder: Path, chain: str = "", **standing: float) -> tuple[str, ...]:
    path = folder / "study.yaml"
    path.write_text(STUDY.replace("module_mass: 40 g", f"module_mass: 40 g{chain}"))
    return assumptions(api.open_study(path), standing)


def test_the_default_is_said(tmp_path: Path) -> None:
    gravity, orientation = said(tmp_path)
    assert gravity == (
        "The model assumes gravity of 9.81 m/s² along world −z (the default), on 20 g beyond the first joint."
    )
    assert "hangs straight down: from base to tip along world −z" in orientation
    assert "bends it toward world +x (the default)" in orientation and "'chain: base'" in orientation


@pytest.mark.parametrize(
    ("base", "words"),
    [
        ("{direction: [1, 0, 0]}", "lies level: from base to tip along world +x"),
        ("{direction: [0, 0, 1]}", "stands upright"),
        ("{direction: [1, 0, -1]}", "points 45° away from straight down"),
    ],
)
def test_a_stated_orientation_is_said(tmp_path: Path, base: str, words: str) -> None:
    orientation = said(tmp_path, f", base: {base}")[1]
    assert words in orientation and "(stated)" in orientation


def test_no_gravity_and_what_stands_now(tmp_path: Path) -> None:
    found = said(tmp_path, ", gravity: [0, 0, 0]", payload_kg=0.02)
    assert "no gravity" in found[0] and found[1:] == ("Set now: payload = 20 g.",)


def test_an_oblique_direction_is_a_vector() -> None:
    assert direction(np.array([1.0, 0.0, -1.0])) == "(0.71, 0, −0.71) in the world"


def test_the_dry_run_says_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    called("example", "experiment").done()
    out = called("experiment", "experiment/finger.yaml", "--dry-run").done().out
    assert "hangs straight down" in out and out.index("hangs straight down") < out.index("pressure (kPa)")
