"""Components of this package. Imported at every start of Pliant, so no heavy library is imported here."""

from collections.abc import Iterable

from pliant.registry.component import Component
from pliant.registry.hookspecs import hookimpl

CONTRACT = 3  # of Pliant's plugins; docs/plugin_contract.md says what a later number changes


@hookimpl
def pliant_components() -> Iterable[Component]:
    """Return the backend."""
    return [
        Component(
            interface="fem",
            kind="calculix",
            config="pliant_calculix.config:CalculixConfig",
            implementation="pliant_calculix.backend:Calculix",
            summary="CalculiX (program ccx) on Abaqus-style decks: an independent code to check others with",
            example={"pressure_max": "15 kPa"},
        )
    ]
