"""Each check is itself tested: a good small plugin passes it, one spoiled in exactly that way fails it by name."""

from __future__ import annotations

import re

import pytest
import spoiled

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

SPOILED = [(interface, spoil) for interface in spoiled.SUITES for spoil in spoiled.of(interface)]


@parametrize_with_checks([spoiled.good(interface) for interface in INTERFACES])
def test_good_plugin_passes(check: BoundCheck) -> None:
    check()


@pytest.mark.parametrize(("suite", "spoil"), SPOILED, ids=[f"{i}-{s.check}" for i, s in SPOILED])
def test_spoiled_plugin_fails(suite: str, spoil: spoiled.Spoil) -> None:
    check = {c.name: c for c in checks_for(spoil.component.interface)}[spoil.check]
    with pytest.raises(CheckFailure) as failure:
        check.run(Subject(spoil.component))
    message = str(failure.value)
    assert message.startswith(f"{spoil.component.label} fails '{spoil.check}': ")
    assert re.search(spoil.says, message), message
    assert message.endswith(f"The contract: {check.clause}")


@pytest.mark.parametrize("suite", spoiled.SUITES)
def test_every_check_has_its_spoiled_plugin(suite: str) -> None:
    shared = {check.name for check in common_checks.suite.checks}
    if suite == "common":
        wanted = shared
    else:
        wanted = {check.name for check in checks_for(suite)} - shared
    assert {spoil.check for spoil in spoiled.of(suite)} == wanted


def test_named_check_refuses_another_interface() -> None:
    with pytest.raises(CheckFailure, match="material 'small' is no family"):
        check_family(spoiled.good("material"))
