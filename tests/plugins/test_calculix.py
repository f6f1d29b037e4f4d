"""The CalculiX backend of contrib, in a fresh environment: found, and it passes its own tests."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

PACKAGE = Path(__file__).parents[2] / "contrib" / "pliant-calculix"


@pytest.fixture(scope="module")
def environment(new_environment: Callable[[], Any]) -> Any:
    made = new_environment()
    made.install([PACKAGE])
    return made


def test_backend_is_found(environment: Any) -> None:
    done = environment.run("-m", "pliant", "plugins", "--json", "-", "--quiet")
    assert done.returncode == 0, done.stderr
    packages = {(c["interface"], c["kind"]): c["package"] for c in json.loads(done.stdout)["components"]}
    assert packages["fem", "calculix"] == "pliant-calculix 0.1.0"


def test_backend_passes_its_own_tests(environment: Any) -> None:
    """Conformance among them. What needs ccx is skipped without it: the decks are judged anyway."""
    done = environment.run("-m", "pytest", "-q", "-p", "no:cacheprovider", PACKAGE / "tests", cwd=PACKAGE)
    assert done.returncode == 0, done.stdout[-2000:]


def test_study_says_that_the_program_is_missing(environment: Any, tmp_path: Path) -> None:
    study = PACKAGE / "examples" / "check.yaml"
    done = environment.run("-m", "pliant", "fem", study, "fem.program=no-such-ccx", "--quiet", cwd=tmp_path)
    assert done.returncode == 2
    assert "apt install calculix-ccx" in " ".join(done.stderr.split())
