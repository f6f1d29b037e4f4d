"""The suite's own behaviour: outcomes, skips, ids, messages."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import spoiled

from pliant.registry.component import INTERFACES
from pliant.testing import CheckFailure, CheckSkipped, bound_checks, check_component, checks_for, run_checks
from pliant.testing.suite import Finding, require_close


def test_outcomes_name_every_check_of_the_interface() -> None:
    outcomes = run_checks(spoiled.good("material"))
    assert [o.name for o in outcomes] == [c.name for c in checks_for("material")]
    assert {o.status for o in outcomes} == {"passed"}
    assert all(o.message == "" and o.wall_s >= 0 for o in outcomes)


def test_a_spoiled_component_is_reported_and_the_rest_still_runs() -> None:
    spoil = next(s for s in spoiled.of("material") if s.check == "tangent_is_symmetric")
    outcomes = {o.name: o for o in run_checks(spoil.component)}
    assert outcomes["tangent_is_symmetric"].status == "failed"
    assert outcomes["stress_is_the_energys_slope"].status == "passed"
    with pytest.raises(CheckFailure, match="tangent_is"):
        check_component(spoil.component)


def test_a_missing_package_skips_with_what_to_install() -> None:
    lacking = replace(spoiled.good("task"), requires=("no_such_package",), install="pip install it")
    outcomes = run_checks(lacking)
    skipped = [o for o in outcomes if o.status == "skipped"]
    assert "task 'small' needs no_such_package: pip install it" in skipped[0].message
    assert {o.status for o in outcomes if o.name.startswith("config_")} == {"passed"}
    assert {o.status for o in outcomes if o.name.startswith("metrics_")} == {"skipped"}
    with pytest.raises(CheckSkipped, match="pip install it"):
        check_component(lacking)


def test_a_component_that_cannot_be_imported_fails_in_words() -> None:
    absent = replace(spoiled.good("effect"), implementation="spoiled.effect:NoSuchClass")
    failed = [o for o in run_checks(absent) if o.status == "failed"]
    assert failed[0].name == "implementation_fills_the_interface"
    assert "NoSuchClass" in failed[0].message


def test_ids_are_readable() -> None:
    ids = [check.id for check in bound_checks([spoiled.good("physics")])]
    assert "physics-small-settles_in_equilibrium" in ids
    assert len(set(ids)) == len(ids)


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
