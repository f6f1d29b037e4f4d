"""A study with some of its keys changed, written as a study writes them: `verify.change`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pliant.config.study import Study
from pliant.config.study_keys import KeyPath
from pliant.registry.discovery import Registry
from pliant.search.keys import StudySetter, study_key

PLACE = "search.verify.change"


def changed(registry: Registry, study: Study, change: Mapping[str, Any]) -> Study:
    """The study with `change` on top: ``{task.trials: 10, chain.base.roll: 30 deg}``.

    Args:
        registry: the plugins, those of the study's own files among them.
        study: validated.
        change: dotted key, with or without its unit, → value; list items by number.

    Raises:
        UserError: a key that the study does not have, or a value that it does not allow.
    """
    if not change:
        return study
    found: dict[KeyPath, Any] = {}
    for written, value in change.items():
        key = study_key(study, registry, written, PLACE)
        found[key.path] = key.parsed(value, written, PLACE)
    return StudySetter(study, registry).study(found)
