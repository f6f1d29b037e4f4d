"""Components of this package. Imported at every start of Pliant, so no heavy library is imported here."""

from collections.abc import Iterable

from pliant.registry.component import Component
from pliant.registry.hookspecs import hookimpl

CONTRACT = 3  # of Pliant's plugins; docs/plugin_contract.md says what a later number changes


@hookimpl
def pliant_components() -> Iterable[Component]:
    """Return the family."""
    return [
        Component(
            interface="family",
            kind="eccentric_tube",
            config="pliant_eccentric_tube.config:EccentricTubeConfig",
            implementation="pliant_eccentric_tube.family:EccentricTube",
            summary="rubber tube with its bore off the axis; pressure bends it toward the thick side",
            example={
                "outer_radius": "6 mm",
                "bore_radius": "3.5 mm",
                "offset": "1.2 mm",
                "module_length": "12 mm",
            },
        )
    ]
