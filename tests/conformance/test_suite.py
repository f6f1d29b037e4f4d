"""The suite's own behaviour: outcomes, skips, ids, messages."""

from __future__ import annotations

from dataclasses import replace

import broken
import numpy as np
import pytest

from pliant.registry.component import INTERFACES
from pliant.testing import CheckFailure, CheckSkipped, check_component, checks_for, run_checks
from pliant.testing.suite import Finding, require_close


def test_outcomes_name_every_check_of_the_interface() -> None:
    outcomes = run_checks(broken.good("material"))
    assert [o.name for o in outcomes] == [c.name for c in checks_for("material")]
    assert {o.status for o in outcomes} == {"passed"}
    assert all(o.message == "" and o.wall_s >= 0 for o in outcomes)


def test_a_broken_component_is_reported_and_the_rest_still_runs() -> None:
    case = next(s for s in broken.of("material") if s.check == "tangent_is_symmetric")
    outcomes = {o.name: o for o in run_checks(case.component)}
    assert outcomes["tangent_is_symmetric"].status == "failed"
    assert outcomes["stress_is_the_energys_slope"].status == "passed"
    with pytest.raises(CheckFailure, match="tangent_is"):
        check_component(case.component)


def test_a_misspelt_key_of_the_example_gives_one_failure_in_one_sentence() -> None:
    misspelt = replace(broken.good("effect"), example={"gian": 1.1})
    (failed,) = [o for o in run_checks(misspelt) if o.status == "failed"]
    assert failed.name == "example_is_valid"
    assert "gian" in failed.message
    assert len(failed.message.splitlines()) == 1
    with pytest.raises(CheckFailure) as failure:
        check_component(misspelt)
    assert str(failure.value) == failed.message


def test_a_misspelt_parameter_in_the_code_gives_one_failure() -> None:
    misspelt = replace(broken.good("effect"), implementation="broken.effect:Misspelt")
    outcomes = run_checks(misspelt)
    (failed,) = [o for o in outcomes if o.status == "failed"]
    assert "has no attribute 'gian'" in failed.message
    assert any(o.message == f"it fails where '{failed.name}' does" for o in outcomes)


def test_what_is_declared_wrongly_stops_the_rest() -> None:
    case = next(c for c in broken.of("effect") if c.check == "declares_place_and_parameters")
    outcomes = run_checks(case.component)
    first = next(k for k, o in enumerate(outcomes) if o.status == "failed")
    assert outcomes[first].name == case.check
    assert {o.status for o in outcomes[:first]} == {"passed"}
    assert {o.message for o in outcomes[first + 1 :]} == {f"not run: '{case.check}' fails first"}


def test_a_missing_package_skips_with_what_to_install() -> None:
    lacking = replace(broken.good("task"), requires=("no_such_package",), install="pip install it")
    outcomes = run_checks(lacking)
    skipped = [o for o in outcomes if o.status == "skipped"]
    assert "task 'small' needs no_such_package: pip install it" in skipped[0].message
    assert {o.status for o in outcomes if o.name.startswith("config_")} == {"passed"}
    assert {o.status for o in outcomes if o.name.startswith("metrics_")} == {"skipped"}
    with pytest.raises(CheckSkipped, match="pip install it"):
        check_component(lacking)


def test_a_component_that_cannot_be_imported_fails_in_words() -> None:
    absent = replace(broken.good("effect"), implementation="broken.effect:NoSuchClass")
    (failed,) = [o for o in run_checks(absent) if o.status == "failed"]
    assert failed.name == "implementation_fills_the_interface"
    assert "NoSuchClass" in failed.message


@pytest.mark.parametrize("interface", INTERFACES)
def test_every_clause_is_a_sentence(interface: str) -> None:
    for check in checks_for(interface):
        assert check.clause.endswith("."), check.name
        assert len(check.clause) < 160, check.name


@pytest.mark.parametrize(
    ("got", "says"),
    [
        ([1.0, 2.1], r"got 2.1, expected 2, allowed difference 0.01"),
        ([1.0], r"shape \(1,\) instead of \(2,\)"),
        ([1.0, np.nan], "not all values are finite"),
    ],
)
def test_differences_are_told_in_numbers(got: list[float], says: str) -> None:
    with pytest.raises(Finding, match=says):
        require_close(got, [1.0, 2.0], "off", atol=0.01)


def test_close_numbers_pass() -> None:
    require_close([1.0, 2.005], [1.0, 2.0], "off", atol=0.01)
