"""What a search depends on, for the keys of its artifacts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pliant.config.study import BLOCKS, Study
from pliant.pipeline.study import DEFAULT_PHYSICS, DEFAULT_SURROGATE, arm_content
from pliant.pipeline.workbench import Workbench, content
from pliant.registry.component import Component

# The code that a search depends on; what it imports counts too.
MODULES = (
    "pliant.search.run.search",
    "pliant.search.evaluate.evaluator",
    "pliant.search.problem.search_problem",
)
# What does not change what a search finds.
APART = ("pliant", "name", "cross_check", "measurements", "uncertainty", "protocols", "plugins", "workers")
# What a search may be continued beyond.
ENDS = ("budget", "generations", "halving", "until", "confirm", "sensitivity", "verify")


def content_of(study: Study, without: Sequence[str]) -> dict[str, Any]:
    """What a search depends on, without some keys of `search`."""
    plain = {key: value for key, value in content(study).items() if key not in APART}
    plain["search"] = {key: value for key, value in plain["search"].items() if key not in without}
    return plain | arm_content(study)


def components_of(bench: Workbench, study: Study, also: Sequence[str] = ()) -> list[Component]:
    """The plugins whose code the search depends on; `also` are engines beside the study's own."""
    wanted = {
        (interface, block.kind)
        for key, interface in BLOCKS.items()
        if (block := getattr(study, key)) is not None
    }
    wanted |= {("effect", effect.kind) for effect in study.effects}
    segments = study.chain.segments if study.chain is not None else ()
    wanted |= {("surrogate", s.surrogate.kind) for s in segments if s.surrogate is not None}
    wanted |= {("physics", kind) for kind in also}
    # What variables and conditions put in the place of the study's own blocks.
    search = study.need("search", "a search")
    settings = [item for condition in search.conditions.values() for item in condition.items()]
    settings += [
        (key, c) for name, one in search.variables.items() for key in one.keys(name) for c in one.choices
    ]
    blocks = [(key.removesuffix(".kind"), str(kind)) for key, kind in settings if key.endswith(".kind")]
    wanted |= {(BLOCKS[block], kind) for block, kind in blocks if block in BLOCKS}
    if study.physics is None:
        wanted.add(("physics", DEFAULT_PHYSICS))
    if study.surrogate is None and study.family is not None:
        wanted.add(("surrogate", DEFAULT_SURROGATE))
    return [bench.registry.get(interface, kind) for interface, kind in sorted(wanted)]
