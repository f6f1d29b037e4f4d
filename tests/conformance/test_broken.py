"""Each check is itself tested: a good small plugin passes it, one broken in exactly that way fails it by name."""

from __future__ import annotations

import re

import broken
import pytest

from pliant.registry.component import INTERFACES
from pliant.testing import (
    BoundCheck,
    CheckFailure,
    Subject,
    check_family,
    checks_for,
    parametrize_with_checks,
)
from pliant.testing import common as common_checks

CASES = [(interface, case) for interface in broken.SUITES for case in broken.of(interface)]


@parametrize_with_checks([broken.good(interface) for interface in INTERFACES])
def test_good_plugin_passes(check: BoundCheck) -> None:
    check()


@pytest.mark.parametrize(("suite", "case"), CASES, ids=[f"{i}-{case.check}" for i, case in CASES])
def test_broken_plugin_fails(suite: str, case: broken.Broken) -> None:
    check = {c.name: c for c in checks_for(case.component.interface)}[case.check]
    with pytest.raises(CheckFailure) as failure:
        check.run(Subject(case.component))
    message = str(failure.value)
    assert message.startswith(f"{case.component.label} fails '{case.check}': ")
    assert re.search(case.says, message), message
    assert message.endswith(f"The contract: {check.clause}")


@pytest.mark.parametrize("suite", broken.SUITES)
def test_every_check_has_its_broken_plugin(suite: str) -> None:
    shared = {check.name for check in common_checks.suite.checks}
    wanted = shared if suite == "common" else {check.name for check in checks_for(suite)} - shared
    assert {case.check for case in broken.of(suite)} == wanted


def test_named_check_refuses_another_interface() -> None:
    with pytest.raises(CheckFailure, match="material 'small' is no family"):
        check_family(broken.good("material"))
