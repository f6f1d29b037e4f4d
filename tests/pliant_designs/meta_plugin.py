"""The stand-in meta-model as a plugin file: studies name it under `plugins`."""

from pliant.registry.component import Component
from pliant.registry.hookspecs import hookimpl

CONTRACT = 3

PLACE = "pliant_designs.stand_in"


@hookimpl
def pliant_components() -> list[Component]:
    return [
        Component(
            "meta_model",
            "stand_in",
            f"{PLACE}:StandInMetaModelConfig",
            f"{PLACE}:StandInMetaModel",
            "one least-squares fit",
            {},
        )
    ]
