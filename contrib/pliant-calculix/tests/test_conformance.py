"""The backend keeps the contract; without the program ccx these checks are skipped with the cause."""

from pliant_calculix.manifest import pliant_components

from pliant.testing import BoundCheck, parametrize_with_checks


@parametrize_with_checks(pliant_components())
def test_conformance(check: BoundCheck) -> None:
    check()
