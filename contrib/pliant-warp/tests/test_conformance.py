"""The engine keeps the contract."""

from pliant_warp.manifest import pliant_components

from pliant.testing import BoundCheck, parametrize_with_checks


@parametrize_with_checks(pliant_components())
def test_conformance(check: BoundCheck) -> None:
    check()
