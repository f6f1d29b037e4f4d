"""Conformance suites in pytest: one test per check, with readable ids."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from pliant.registry.component import Component
from pliant.testing.suite import BoundCheck, Subject, checks_for


def bound_checks(components: Iterable[Component]) -> list[BoundCheck]:
    """Every check of every component; the checks of one component share a subject."""
    bound = []
    for component in components:
        subject = Subject(component)
        bound += [BoundCheck(check, subject) for check in checks_for(component.interface)]
    return bound


def parametrize_with_checks(components: Iterable[Component]) -> Any:
    """Parametrize a test by all checks of all components, in the manner of scikit-learn.

    ::

        @parametrize_with_checks(pliant_components())
        def test_conformance(check):
            check()

    Ids read physics-quasistatic-settles_in_equilibrium; a missing dependency skips with its cause.
    """
    import pytest  # only tests need it

    bound = bound_checks(components)
    return pytest.mark.parametrize("check", bound, ids=[check.id for check in bound])
