"""`pliant check`: a user's config, a single clause, the duration of each check, and a missing docstring."""

from __future__ import annotations

import json
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Literal

import pytest
from tests.conformance import broken
from typer.testing import CliRunner

from pliant.cli.verbs import app
from pliant.errors import UserError
from pliant.interfaces.fem import FEMBackend, FemConfig, ModuleSolver
from pliant.interfaces.material import Material
from pliant.records.fem import ModuleProblem
from pliant.registry.component import Component
from pliant.registry.discovery import discover
from pliant.testing import Subject, run_checks
from pliant.testing.box import box_problem
from pliant.testing.stand_ins import sample_material

EFFECT = broken.good("effect")


def test_every_config_under_test_has_the_keys_that_are_given() -> None:
    dead_zone = discover().get("effect", "dead_zone")
    for key in ("threshold", "threshold_pa"):
        subject = Subject(dead_zone, {key: "3 kPa"})
        assert subject.config.threshold_pa == 3000  # type: ignore[attr-defined]
        assert subject.plain_config.threshold_pa == 3000  # type: ignore[attr-defined]


def test_keys_on_the_command_line(tmp_path: Path) -> None:
    target = tmp_path / "out.json"
    clauses = ["--clause", "config_is_frozen", "--clause", "describes_itself"]
    arguments = ["check", "effect", "dead_zone", "threshold=3 kPa", *clauses, "--json", str(target)]
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 0, done.output
    checks = json.loads(target.read_text())["checks"]
    assert {check["name"] for check in checks} == {"config_is_frozen", "describes_itself"}
    assert all(check["wall_s"] >= 0 for check in checks)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["treshold=3 kPa"], "'treshold' is not a key of effect; did you mean 'threshold'"),
        (["threshold=-1 Pa"], "threshold"),
        (["threshold"], "is not an override"),
        (["--clause", "config_is_frosen"], "did you mean 'config_is_frozen'"),
    ],
)
def test_wrong_keys_and_clauses_are_refused(arguments: list[str], says: str) -> None:
    done = CliRunner().invoke(app, ["check", "effect", "dead_zone", *arguments])
    assert (done.exit_code, says in " ".join(done.output.split())) == (2, True), done.output


def test_a_missing_docstring_is_reported_and_stops_nothing() -> None:
    outcomes = {o.name: o for o in run_checks(replace(EFFECT, summary="two\nlines"))}
    assert outcomes["describes_itself"].status == "failed"
    assert [o.name for o in outcomes.values() if o.message.startswith("not run")] == []
    assert sum(o.status == "passed" for o in outcomes.values()) > 20


def test_what_a_check_takes_is_counted() -> None:
    (one,) = run_checks(EFFECT, clauses=["config_imports_nothing_heavy"])
    assert one.wall_s > 0


@dataclass(frozen=True, eq=False)
class OwnProblem(ModuleProblem):
    """A problem with data that only `OwnFem` needs."""

    thread_m: float = 0.0


class OwnConfig(FemConfig):
    """The config of a backend for `OwnProblem`."""

    kind: Literal["own"] = "own"


class OwnFem(FEMBackend):
    """A backend that reads data which only its own problems have."""

    problem_class = OwnProblem
    config: OwnConfig

    def solver(self, problem: ModuleProblem, material: Material) -> ModuleSolver:
        assert isinstance(problem, OwnProblem)
        raise UserError(f"a thread of {problem.thread_m} m")


OWN = Component(
    "fem", "own", f"{__name__}:OwnConfig", f"{__name__}:OwnFem", "own problems", {"pressure_max": "8 kPa"}
)


def test_a_backend_for_its_own_problems_is_given_no_others() -> None:
    outcomes = run_checks(OWN)
    failed = [(o.name, o.message) for o in outcomes if o.status == "failed"]
    assert failed == []
    assert any("solves problems of class OwnProblem alone" in o.message for o in outcomes)


def test_such_a_backend_refuses_other_problems_by_its_class() -> None:
    backend: FEMBackend = OWN.build(OwnConfig.model_validate({"kind": "own", "pressure_max": "8 kPa"}))
    box, material = box_problem(), sample_material()
    with pytest.raises(
        UserError, match="solves problems of class OwnProblem alone, and this family's is a ModuleP"
    ):
        backend.checked_solver(box, material)
    values: dict[str, Any] = {f.name: getattr(box, f.name) for f in fields(ModuleProblem)}
    with pytest.raises(UserError, match=r"a thread of 0.2 m"):
        backend.solver(OwnProblem(**values, thread_m=0.2), material)
