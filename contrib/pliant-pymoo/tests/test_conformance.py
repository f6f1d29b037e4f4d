"""Both optimizers keep the contract."""

from pliant_pymoo.manifest import pliant_components

from pliant.testing import BoundCheck, parametrize_with_checks


@parametrize_with_checks(pliant_components())
def test_conformance(check: BoundCheck) -> None:
    check()
