"""The worked example of docs/calibrate_a_material.md, run as written."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from pliant.cli.verbs import app
from pliant.mechanics.homogeneous import incompressible_stress
from pliant.registry.discovery import discover

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/calibrate_a_material.md").read_text(encoding="utf-8")


def shown(folder: Path, monkeypatch: pytest.MonkeyPatch, number: int) -> tuple[str, str]:
    """Return the text that the page quotes for its console block of this number and the command's actual output."""
    monkeypatch.chdir(folder)
    if not (folder / "examples").exists():
        (folder / "examples").symlink_to(ROOT / "examples")
    command, quoted = re.findall(r"\$ pliant ([^\n]*)\n```\n\n```\n(.*?)```", PAGE, re.DOTALL)[number]
    done = CliRunner().invoke(app, shlex.split(command))
    assert done.exit_code == 0, done.output
    return quoted, done.stdout


def test_the_tensile_example_says_what_the_page_shows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    quoted, said = shown(tmp_path, monkeypatch, 0)
    assert [line.split() for line in said.splitlines()] == [line.split() for line in quoted.splitlines()]


@pytest.mark.slow
def test_the_free_curve_says_what_the_page_shows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    quoted, said = shown(tmp_path, monkeypatch, 1)
    (wanted,), (got,) = (re.findall(r"shear_modulus +([\d.]+)", text) for text in (quoted, said))
    assert float(got) == pytest.approx(float(wanted), rel=3e-3)
    assert abs(float(got) - 231) < 3


def test_the_table_is_what_its_first_lines_say() -> None:
    """The table has three specimens of the law and seed that its first lines state."""
    component = discover().get("material", "ogden")
    rows = [line.split(",") for line in (ROOT / "examples/materials/pull.csv").read_text().splitlines()[3:]]
    rng, stretch, made = np.random.default_rng(5), np.linspace(1.05, 2.4, 28), []
    for scale in (0.99, 1.0, 1.02):
        keys = {"kind": "ogden", "mu": [scale * 200e3, scale * 40e3], "alpha": [1.8, -2.5]}
        solid = component.build(component.config_model().model_validate(keys))
        made.append(incompressible_stress(solid, stretch) / 1e3 + 1.5 * rng.standard_normal(28))
    np.testing.assert_allclose([float(row[1]) for row in rows], np.concatenate(made), atol=0.051)


def test_the_abaqus_table_is_true() -> None:
    """The table agrees with C10 = μ/2 and with D1 = 2/K for the stated K."""
    registry = discover()
    component = registry.get("material", "mooney_rivlin")
    solid = component.build(component.config_model().model_validate({"kind": "mooney_rivlin", "c10": 1e5}))
    assert solid.shear_modulus_pa == 2e5
    nu = 0.49
    assert solid.bulk_modulus_pa == pytest.approx(2 * 2e5 * (1 + nu) / (3 * (1 - 2 * nu)))
    volume = np.diag([1.01] * 3)
    energy = float(solid.energy(volume))
    assert energy == pytest.approx((1.01**3 - 1) ** 2 * solid.bulk_modulus_pa / 2)
