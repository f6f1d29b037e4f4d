"""Content that a search depends on, for the keys of its artifacts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pliant.config.study import Study
from pliant.pipeline.study import DEFAULT_PHYSICS, DEFAULT_SURROGATE, arm_content
from pliant.pipeline.workbench import RunContext, content
from pliant.registry.block import kind_blocks
from pliant.registry.component import Component

# The code that a search depends on; its imports are included.
MODULES = (
    "pliant_search.run.search",
    "pliant_search.evaluate.evaluator",
    "pliant_search.problem.search_problem",
)
# Keys that do not affect the result of a search.
APART = ("pliant", "name", "cross_check", "measurements", "uncertainty", "protocols", "plugins", "workers")
# Keys that may be increased to continue a search.
ENDS = ("budget", "generations", "halving", "until", "polish", "confirm", "sensitivity", "verify")


def search_content(study: Study, without: Sequence[str]) -> dict[str, Any]:
    """Return the content of a study that its search depends on, without some keys of `search`."""
    plain = {key: value for key, value in content(study).items() if key not in APART}
    plain["search"] = {key: value for key, value in plain["search"].items() if key not in without}
    return plain | arm_content(study)


def search_components(context: RunContext, study: Study, also: Sequence[str] = ()) -> list[Component]:
    """Return the plugins whose code the search depends on; `also` are engines in addition to the study's own."""
    interfaces = kind_blocks()
    wanted = {
        (interface, block.kind)
        for key, interface in interfaces.items()
        if (block := study.block(key)) is not None
    }
    wanted |= {("effect", effect.kind) for effect in study.effects}
    segments = study.chain.segments if study.chain is not None else ()
    wanted |= {("surrogate", s.surrogate.kind) for s in segments if s.surrogate is not None}
    wanted |= {("physics", kind) for kind in also}
    # Blocks that variables and conditions put in place of the study's own.
    search = study.need("search", "a search")
    settings = [item for condition in search.conditions.values() for item in condition.items()]
    settings += [
        (key, c) for name, one in search.variables.items() for key in one.keys(name) for c in one.choices
    ]
    blocks = [(key.removesuffix(".kind"), str(kind)) for key, kind in settings if key.endswith(".kind")]
    wanted |= {(interfaces[block], kind) for block, kind in blocks if block in interfaces}
    if study.physics is None:
        wanted.add(("physics", DEFAULT_PHYSICS))
    if study.surrogate is None and study.family is not None:
        wanted.add(("surrogate", DEFAULT_SURROGATE))
    return [context.registry.get(interface, kind) for interface, kind in sorted(wanted)]
