"""A third-party family and broken packages in a fresh environment: found, checked, run from a study file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from tests.plugins.conftest import CONTRIB

EXAMPLES = CONTRIB / "pliant-eccentric-tube" / "examples"
SMALL = ["fem.pressures=3", "fem.angles=4", "fem.check_states=3", "chain.modules=2"]


@pytest.fixture(scope="module")
def listed(environment: Any) -> dict[str, Any]:
    """Return the JSON of `pliant plugins` in that environment."""
    done = environment.run("-m", "pliant", "plugins", "--json", "-", "--quiet")
    assert done.returncode == 0, done.stderr
    result: dict[str, Any] = json.loads(done.stdout)
    return result


def test_third_party_family_is_found(listed: dict[str, Any]) -> None:
    packages = {(c["interface"], c["kind"]): c["package"] for c in listed["components"]}
    assert packages["family", "eccentric_tube"] == "pliant-eccentric-tube 0.1.0"
    assert packages["material", "neo_hookean"].startswith("pliant ")
    assert ("family", "bellow_helical") not in packages  # a broken package defines it a second time


@pytest.mark.parametrize(
    ("name", "error"), [("broken_import", "ModuleNotFoundError: "), ("broken_answer", "TypeError: ")]
)
def test_broken_package_is_named_with_its_cause(listed: dict[str, Any], name: str, error: str) -> None:
    failed = {failure["name"]: failure for failure in listed["failed"]}
    assert failed[name]["package"].replace("-", "_") == f"{name} 0.1"
    assert failed[name]["cause"].startswith(error)


def test_a_package_for_contract_1_is_named_with_what_to_change(
    listed: dict[str, Any], environment: Any, tmp_path: Path
) -> None:
    (old,) = [failure for failure in listed["failed"] if failure["name"] == "broken_old"]
    assert "states no contract" in old["cause"]
    assert "CONTRACT = 3" in old["cause"]
    done = environment.run("-m", "pliant", "check", "effect", "old_gain", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.count("effect 'old_gain' of") == 1
    assert "Traceback" not in done.stderr


def test_kind_defined_twice_names_both_packages(listed: dict[str, Any]) -> None:
    (clash,) = [failure for failure in listed["failed"] if "bellow_helical" in failure["name"]]
    assert "defined twice" in clash["cause"]
    assert "pliant 0" in clash["package"]
    assert "broken" in clash["package"]


@pytest.mark.slow
def test_conformance_by_command(environment: Any) -> None:
    done = environment.run("-m", "pliant", "check", "family", "eccentric_tube", "--json", "-", "--quiet")
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["failed"] == 0
    assert result["passed"] > 20


@pytest.mark.slow
def test_study_runs_with_the_third_party_family(environment: Any, tmp_path: Path) -> None:
    study = EXAMPLES / "eccentric_tube.yaml"
    done = environment.run(
        "-m", "pliant", "simulate", study, *SMALL, "--json", "result.json", "--quiet", cwd=tmp_path
    )
    assert done.returncode == 0, done.stderr
    result = json.loads((tmp_path / "result.json").read_text())
    assert result["converged"]
    # bends toward the thick side: positive, toward world +x
    assert all(angle > 0.01 for angle in result["joint_angles_rad"])
    assert result["tip_m"][0] > 1e-4


def test_twice_defined_kind_is_refused_in_a_study(environment: Any, tmp_path: Path) -> None:
    study = tmp_path / "study.yaml"
    example = (EXAMPLES / "eccentric_tube.yaml").read_text()
    study.write_text(example.replace("kind: eccentric_tube", "kind: bellow_helical"))
    done = environment.run("-m", "pliant", "simulate", study, cwd=tmp_path)
    assert done.returncode == 2
    assert "bellow_helical" in done.stderr
    assert "uninstall one of them" in " ".join(done.stderr.split())
