"""The optimizers of contrib, in a fresh environment: found, and they search without a change to core."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from tests.cli.search_study import BUDGET, STUDY

from pliant.config.loading import load_study
from pliant.registry.discovery import discover

pytest.importorskip("pymoo")
PACKAGE = Path(__file__).parents[2] / "contrib" / "pliant-pymoo"


@pytest.fixture(scope="module")
def environment(new_environment: Callable[[], Any]) -> Any:
    made = new_environment()
    made.install([PACKAGE])
    return made


def test_optimizers_are_found(environment: Any) -> None:
    done = environment.run("-m", "pliant", "plugins", "--json", "-", "--quiet")
    assert done.returncode == 0, done.stderr
    packages = {(c["interface"], c["kind"]): c["package"] for c in json.loads(done.stdout)["components"]}
    assert packages["optimizer", "de"] == packages["optimizer", "nsga2"] == "pliant-pymoo 0.1.0"


def test_optimizers_pass_their_own_tests(environment: Any) -> None:
    """Conformance among them."""
    done = environment.run("-m", "pytest", "-q", "-p", "no:cacheprovider", PACKAGE / "tests", cwd=PACKAGE)
    assert done.returncode == 0, done.stdout[-2000:]


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
