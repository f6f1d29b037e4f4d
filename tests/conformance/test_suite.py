"""The suite itself: correct small plugins pass, each broken one fails by the check it breaks, outcomes are true."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.conformance import broken

from pliant.registry.interface import interfaces
from pliant.testing import (
    BoundCheck,
    CheckFailure,
    CheckSkipped,
    Finding,
    Subject,
    agree,
    check_component,
    check_family,
    checks_for,
    parametrize_with_checks,
    run_checks,
)

CASES = [(interface, case) for interface in broken.SUITES for case in broken.broken_components(interface)]
# Checks that solve or fit for half a second; other checks of their suites do so in the fast tests.
COSTLY = {
    *(
        ("fem", name)
        for name in ("states_have_all_axes", "tendon_works_on_its_travel", "scales_with_the_module")
    ),
    ("fem", "small_extensions_follow_rod_theory"),
    *(("meta_model", name) for name in ("laws_match_the_joint", "joints_do_not_affect_each_other")),
    *(
        ("meta_model", name)
        for name in ("laws_create_no_energy", "slopes_are_derivatives", "predicts_three_axes")
    ),
}
# Checks that their broken plugin fails by raising an exception.
RAISING = {
    "answers_before_all_is_told",
    "begins_at_a_guess",
    "closes_cleanly",
    "config_keeps_the_bounds",
    "config_subclasses_the_interface",
    "continues_from_a_saved_state",
    "example_is_valid",
    "input_maps_keep_the_run",
    "model_runs_under_a_task",
    "runs_on_one_joint",
    "survives_failed_evaluations",
    "terms_are_the_same_compiled",
}


@parametrize_with_checks(
    [broken.good(interface) for interface in broken.SUITES if interface not in ("common", "fem")]
)
def test_good_plugin_passes(check: BoundCheck) -> None:
    """The correct fem plugin is a shipped one, checked with all shipped components."""
    check()


@pytest.mark.parametrize(
    ("suite", "case"),
    [
        pytest.param(
            i, case, id=f"{i}-{case.check}", marks=[pytest.mark.slow] if (i, case.check) in COSTLY else []
        )
        for i, case in CASES
    ],
)
def test_broken_plugin_fails(suite: str, case: broken.Broken) -> None:
    check = {c.name: c for c in checks_for(case.component.interface)}[case.check]
    with pytest.raises(CheckFailure) as failure:
        check.run(Subject(case.component))
    message = str(failure.value)
    assert message.startswith(f"{case.component.label} fails '{case.check}': ")
    assert message.endswith(f"The contract: {check.clause}")
    assert failure.value.raised_at is None or case.check in RAISING, message


@pytest.mark.parametrize("suite", broken.SUITES)
def test_every_check_has_its_broken_plugin(suite: str) -> None:
    shared = {check.name for check in checks_for("task")} & {check.name for check in checks_for("viewer")}
    wanted = shared if suite == "common" else {check.name for check in checks_for(suite)} - shared
    assert {case.check for case in broken.broken_components(suite)} == wanted


def test_named_check_refuses_another_interface() -> None:
    with pytest.raises(CheckFailure, match="material 'small' is no family"):
        check_family(broken.good("material"))


def test_a_broken_component_is_reported_and_the_rest_still_runs() -> None:
    case = next(s for s in broken.broken_components("material") if s.check == "tangent_is_the_stress_slope")
    outcomes = {o.name: o for o in run_checks(case.component)}
    assert list(outcomes) == [check.name for check in checks_for("material")]
    assert outcomes["tangent_is_the_stress_slope"].status == "failed"
    assert outcomes["stress_is_the_energys_slope"].status == "passed"
    with pytest.raises(CheckFailure, match="tangent_is_the_stress_slope"):
        check_component(case.component)


@pytest.mark.parametrize(
    ("change", "check", "says"),
    [
        ({"example": {"gian": 1.1}}, "example_is_valid", "gian"),
        ({"implementation": f"{broken.__name__}.effect:Misspelt"}, None, "has no attribute 'gian'"),
        (
            {"implementation": f"{broken.__name__}.effect:Misstated"},
            None,
            "GainConfig refuses its block: 'gian' is not a key of effect; did you mean 'gain'? Allowed: kind, gain",
        ),
        (
            {"config": f"{broken.__name__}.effect:NarrowConfig"},
            "config_keeps_the_bounds",
            "less than or equal to 5",
        ),
        (
            {"implementation": f"{broken.__name__}.effect:NoSuch"},
            "implementation_fills_the_interface",
            "NoSuch",
        ),
    ],
)
def test_one_mistake_gives_one_failure_in_one_sentence(
    change: dict[str, object], check: str | None, says: str
) -> None:
    mistaken = replace(broken.good("effect"), **change)  # type: ignore[arg-type]
    outcomes = run_checks(mistaken)
    (failed,) = [o for o in outcomes if o.status == "failed"]
    assert check in (None, failed.name)
    assert says in failed.message and len(failed.message.splitlines()) == 1
    assert "pydantic" not in failed.message
    assert check or any(o.message == f"it fails where '{failed.name}' does" for o in outcomes)
    with pytest.raises(CheckFailure) as failure:
        check_component(mistaken)
    assert str(failure.value) == failed.message


def test_a_refused_example_is_called_one() -> None:
    mistaken = replace(broken.good("family"), example={"wall": "9 mm"})
    (failed,) = [o for o in run_checks(mistaken) if o.status == "failed"]
    assert failed.name == "implementation_fills_the_interface"
    assert "the design that its manifest states as the example is refused: box needs room" in failed.message


def test_what_is_declared_wrongly_stops_the_rest() -> None:
    case = next(c for c in broken.broken_components("effect") if c.check == "declares_place_and_parameters")
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


@pytest.mark.parametrize("interface", interfaces())
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
    agree([1.0, 2.005], [1.0, 2.0], "off", atol=0.01)
    with pytest.raises(Finding, match=says):
        agree(got, [1.0, 2.0], "off", atol=0.01)
