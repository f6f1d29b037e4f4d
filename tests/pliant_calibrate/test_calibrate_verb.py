"""`pliant calibrate`: the table, the JSON, the new study, exit codes."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

sys.path.insert(0, str(Path(__file__).parent))
from calibration_tables import REGISTRY, config, stress, write

from pliant.cli.verbs import app
from pliant.config.loading import load_study

STRETCH = np.linspace(0.8, 2.2, 25)
TRUE = (200e3, 1.4)
NOISE = 1e3 * np.random.default_rng(2).standard_normal(len(STRETCH))


def pulled(mu: float, alpha: float) -> np.ndarray:
    return stress(config("ogden", mu=[mu], alpha=[alpha]), STRETCH)


BLOCK = """\
# my silicone
pliant: 1
name: silicone
material:
  kind: ogden      # Abaqus' convention
  mu_pa: [1e5]     # a guess
  alpha: [2.5]
  density: 1100 kg/m^3
chain: {modules: 2}   # kept
"""
FLOW = "pliant: 1\nname: silicone\nmaterial: {kind: neo_hookean, shear_modulus: 100 kPa}  # a guess\n"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "pull.csv", "stretch,nominal_stress_pa", STRETCH, pulled(*TRUE) + NOISE)
    (tmp_path / "block.yaml").write_text(BLOCK)
    (tmp_path / "flow.yaml").write_text(FLOW)
    (tmp_path / "heir.yaml").write_text("pliant: 1\nextends: flow.yaml\nname: heir\n")
    return tmp_path


def call(*words: str, code: int = 0) -> str:
    done = CliRunner().invoke(app, ["calibrate", *words])
    assert done.exit_code == code, done.output
    return done.output


def test_the_result_and_the_new_study(folder: Path) -> None:
    said = call("block.yaml", "--data", "pull.csv", "--out", "new.yaml", "--full", "--json", "r.json")
    result = json.loads((folder / "r.json").read_text())
    assert result["command"] == "calibrate"
    assert result["parameters"]["mu_pa.0"]["unit"] == "Pa"
    for name, truth in zip(("mu_pa.0", "alpha.0"), TRUE, strict=True):
        one = result["parameters"][name]
        assert abs(one["value"] - truth) < 4 * one["sd"] < 0.1 * truth
    assert np.shape(result["correlation"]) == (2, 2)
    assert result["n"] == 25
    assert result["range"] == {"stretch": [0.8, 2.2]}
    slopes = np.stack([pulled(201e3, 1.4) - pulled(*TRUE), pulled(200e3, 1.401) - pulled(*TRUE)], axis=1)
    left = NOISE - slopes @ np.linalg.lstsq(slopes, NOISE, rcond=None)[0]  # data that no constants can fit
    assert result["rmse"] == pytest.approx(np.sqrt(np.mean(left**2)), rel=1e-3)
    assert result["rmse_of_range"] == pytest.approx(result["rmse"] / np.ptp([*read("pull.csv"), 0]))
    assert "25 rows, stretch 0.8 to 2.2" in said
    text = (folder / "new.yaml").read_text()
    for comment in ("# my silicone", "# Abaqus' convention", "# a guess", "# kept", "# fitted to pull.csv"):
        assert comment in text
    new = load_study(folder / "new.yaml", REGISTRY)
    assert new.material.mu_pa[0] == pytest.approx(result["parameters"]["mu_pa.0"]["value"], rel=1e-5)
    assert new.material.density_kg_m3 == 1100


def read(name: str) -> list[float]:
    return [float(line.split(",")[1]) for line in Path(name).read_text().splitlines()[1:]]


def test_a_second_calibration_replaces_its_own_comments(folder: Path) -> None:
    call("block.yaml", "--data", "pull.csv", "--out", "new.yaml", "--full")
    call("new.yaml", "--data", "pull.csv", "--out", "newer.yaml", "--full")
    new, newer = (folder / "new.yaml").read_text(), (folder / "newer.yaml").read_text()
    assert newer.count("fitted to") == new.count("fitted to") == 1
    assert newer.count("±") == new.count("±") == 2


@pytest.mark.parametrize("source", ["flow.yaml", "heir.yaml"])
def test_a_block_on_one_line_or_in_another_file(source: str, folder: Path) -> None:
    call(source, "--data", "pull.csv", "--out", "new.yaml", "material.poisson_ratio=0.48")
    material = load_study(folder / "new.yaml", REGISTRY).material
    assert material.shear_modulus_pa != 100e3
    assert material.poisson_ratio == 0.48
    assert "fitted to pull.csv" in (folder / "new.yaml").read_text()


def test_constants_that_are_not_told_apart_write_no_study(folder: Path) -> None:
    stretch = np.linspace(0.995, 1.005, 12)
    values = stress(config("neo_hookean", shear_modulus=240e3), stretch)
    noise = 100 * np.random.default_rng(0).standard_normal(12)
    write(folder / "tiny.csv", "stretch,nominal_stress_pa", stretch, values + noise)
    words = [
        "flow.yaml",
        "material={kind: mooney_rivlin, c10: 90 kPa}",
        "--data",
        "tiny.csv",
        "--out",
        "new.yaml",
    ]
    said = call(*words, code=3)
    assert "do not determine c10 and c01 separately" in " ".join(said.split())
    assert not (folder / "new.yaml").exists()


def test_wrong_calls_end_with_2(folder: Path) -> None:
    assert "name the data" in call("flow.yaml", code=2)
    assert "no such file" in call("flow.yaml", "--data", "none.csv", code=2)
    assert "never overwritten" in call("flow.yaml", "--data", "pull.csv", "--out", "flow.yaml", code=2)
    (folder / "there.yaml").write_text("x")
    assert "is there already" in call("flow.yaml", "--data", "pull.csv", "--out", "there.yaml", code=2)


def test_the_function_gives_the_same(folder: Path) -> None:
    from pliant import api

    found = api.calibrate(api.open_study("block.yaml"), "pull.csv", fit=["mu"])
    assert [c.name for c in found.constants] == ["mu_pa.0"]
    assert found.config.alpha == (2.5,)
