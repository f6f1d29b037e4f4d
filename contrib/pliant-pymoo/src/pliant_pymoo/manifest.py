"""Components of this package. Imported at every start of Pliant, so no heavy library is imported here."""

from collections.abc import Iterable

from pliant.registry.component import Component
from pliant.registry.hookspecs import hookimpl

CONTRACT = 3  # of Pliant's plugins; docs/plugin_contract.md says what a later number changes


@hookimpl
def pliant_components() -> Iterable[Component]:
    """Return the two optimizers."""
    return [
        Component(
            interface="optimizer",
            kind="de",
            config="pliant_pymoo.config:DeConfig",
            implementation="pliant_pymoo.evolution:De",
            summary="differential evolution (pymoo): one objective, rugged landscapes, thousands of candidates",
            requires=("pymoo",),
            install="pip install pliant-pymoo",
        ),
        Component(
            interface="optimizer",
            kind="nsga2",
            config="pliant_pymoo.config:Nsga2Config",
            implementation="pliant_pymoo.evolution:Nsga2",
            summary="NSGA-II (pymoo): a front of best compromises between several objectives",
            requires=("pymoo",),
            install="pip install pliant-pymoo",
        ),
    ]
