"""Packages of contrib and skeletons in a fresh environment: found, passing their own tests, core unchanged."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import pytest
from tests.cli.search_study import BUDGET, STUDY
from tests.plugins.conftest import CONTRIB, HAS_PYMOO, HAS_WARP

from pliant.cli.plugins import EXAMPLES
from pliant.config.loading import load_study
from pliant.registry.discovery import discover

needs_pymoo = pytest.mark.skipif(not HAS_PYMOO, reason="needs pymoo: pip install pymoo")
needs_warp = pytest.mark.skipif(not HAS_WARP, reason="needs mujoco_warp: pip install mujoco-warp")
each = pytest.mark.parametrize(
    "name",
    [
        "pliant-calculix",
        pytest.param("pliant-pymoo", marks=needs_pymoo),
        pytest.param("pliant-warp", marks=needs_warp),
    ],
)
KINDS = {
    "pliant-calculix": {("fem", "calculix")},
    "pliant-pymoo": {("optimizer", "de"), ("optimizer", "nsga2")},
    "pliant-warp": {("physics", "mujoco_warp")},
}


@pytest.mark.slow
@each
def test_its_kinds_are_found(environment: Any, name: str) -> None:
    done = environment.run("-m", "pliant", "plugins", "--json", "-", "--quiet")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)["components"]
    assert KINDS[name] <= {(c["interface"], c["kind"]) for c in found if c["package"] == f"{name} 0.1.0"}


@pytest.mark.slow
@pytest.mark.parametrize("name", [*KINDS, "pliant-eccentric-tube"])
def test_it_passes_its_own_tests(own_tests: dict[str, list[str]], name: str) -> None:
    """Includes conformance tests. Tests that need ccx are skipped without it; the decks are checked in any case."""
    if name == "pliant-pymoo" and not HAS_PYMOO:
        pytest.skip("needs pymoo: pip install pymoo")
    if name == "pliant-warp" and not HAS_WARP:
        pytest.skip("needs mujoco_warp: pip install mujoco-warp")
    assert set(own_tests[name]) == {"passed"}


@pytest.mark.slow
@pytest.mark.parametrize("interface", EXAMPLES)
def test_a_skeleton_passes_its_own_tests(own_tests: dict[str, list[str]], interface: str) -> None:
    assert set(own_tests[f"my-{interface}"]) == {"passed"}


@pytest.mark.slow
def test_a_study_says_that_the_program_is_missing(environment: Any, tmp_path: Path) -> None:
    study = CONTRIB / "pliant-calculix" / "examples" / "check.yaml"
    done = environment.run("-m", "pliant", "fem", study, "fem.program=no-such-ccx", "--quiet", cwd=tmp_path)
    assert done.returncode == 2
    assert "apt install calculix-ccx" in " ".join(done.stderr.split())


@pytest.mark.slow
@needs_pymoo
def test_differential_evolution_searches_a_study(environment: Any, tmp_path: Path) -> None:
    (tmp_path / "study.yaml").write_text(STUDY)
    change = ["optimizer={kind: de, population: 12}", f"search.budget={3 * BUDGET}"]
    command = ["-m", "pliant", "optimize", "study.yaml", *change, "--workers", "1", "--quiet"]
    done = environment.run(*command, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    folder = tmp_path / "runs" / "toy"
    result = json.loads((folder / "optimize.json").read_text())
    with (folder / "history.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == result["evaluations"] == 3 * BUDGET
    first, later = ([float(row["abs(tip_x - 10 mm)"]) for row in part] for part in (rows[:12], rows[12:]))
    assert result["objective"] == min(later) < 0.2 * min(first)
    best = load_study(folder / "best.yaml", discover())
    assert best.task.pressure_pa == result["best"]["controls"]["task.pressure_pa"]
    assert (folder / "search.html").is_file()
