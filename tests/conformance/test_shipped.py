"""Every component that ships passes its interface's whole suite."""

from pliant.testing import BoundCheck, parametrize_with_checks
from pliant_plugins.manifest import pliant_components


@parametrize_with_checks(pliant_components())
def test_shipped(check: BoundCheck) -> None:
    check()
