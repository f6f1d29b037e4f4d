"""Conformance suites for plugin authors: what the contracts say, as checks that name the likely cause.

One file per interface holds its checks; `suite` runs them in stages, `parametrize_with_checks` makes one test of each
component; `samples`, `solved_samples`, `box`, `stand_ins` and `meta_model_stand_in` are the laws, chains, problems and
small implementations that checks and tests use.
"""

from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

from pliant.registry.component import Component
from pliant.testing.suite import (
    Check,
    CheckFailure,
    CheckOutcome,
    CheckSkipped,
    Subject,
    check_component,
    checks_for,
    run_checks,
)

# What a test made by `parametrize_with_checks` gets and calls.
BoundCheck = Callable[[], None]


def parametrize_with_checks(components: Iterable[Component]) -> Any:
    """Parametrize a test by components: one test runs the suite of one of them, in stages.

    ::

        @parametrize_with_checks(pliant_components())
        def test_conformance(check):
            check()

    Ids read physics-quasistatic; a missing dependency skips with its cause, a failure has a sentence for each cause.
    """
    import pytest  # only tests need it

    every = list(components)
    checks: list[BoundCheck] = [partial(check_component, component) for component in every]
    return pytest.mark.parametrize("check", checks, ids=[f"{c.interface}-{c.kind}" for c in every])


# One name per interface: the whole suite of a component that must be of this interface.
check_family = partial(check_component, interface="family")
check_material = partial(check_component, interface="material")
check_fem = partial(check_component, interface="fem")
check_surrogate = partial(check_component, interface="surrogate")
check_meta_model = partial(check_component, interface="meta_model")
check_effect = partial(check_component, interface="effect")
check_physics = partial(check_component, interface="physics")
check_task = partial(check_component, interface="task")
check_optimizer = partial(check_component, interface="optimizer")
check_viewer = partial(check_component, interface="viewer")

__all__ = [
    "BoundCheck",
    "Check",
    "CheckFailure",
    "CheckOutcome",
    "CheckSkipped",
    "Subject",
    "check_component",
    "check_effect",
    "check_family",
    "check_fem",
    "check_material",
    "check_meta_model",
    "check_optimizer",
    "check_physics",
    "check_surrogate",
    "check_task",
    "check_viewer",
    "checks_for",
    "parametrize_with_checks",
    "run_checks",
]
