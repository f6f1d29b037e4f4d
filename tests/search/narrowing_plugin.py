"""Optimizers of `toy_search` as a plugin file: studies name it under `plugins`."""

from pliant.registry.component import Component
from pliant.registry.hookspecs import hookimpl

CONTRACT = 3

HERE = "tests.search.toy_search"


@hookimpl
def pliant_components():
    return [
        Component("optimizer", kind, f"{HERE}:{config}", f"{HERE}:{implementation}", "for tests")
        for kind, config, implementation in (
            ("narrowing", "NarrowingConfig", "Narrowing"),
            ("contextual", "ContextualConfig", "Contextual"),
            ("front", "FrontConfig", "Front"),
            ("knowing", "KnowingConfig", "Knowing"),
        )
    ]
