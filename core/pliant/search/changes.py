"""A study with some of its keys changed, written as a study writes them: `verify.change`, `confirm.change`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pliant.config.study import Study
from pliant.config.study_keys import KeyPath
from pliant.registry.discovery import Registry
from pliant.search.keys import StudySetter, study_key

PLACE = "search.verify.change"


def changed(registry: Registry, study: Study, change: Mapping[str, Any], place: str = PLACE) -> Study:
    """The study with `change` on top: ``{task.trials: 10, chain.base.roll: 30 deg}``.

    Args:
        registry: the plugins, those of the study's own files among them.
        study: validated.
        change: dotted key, with or without its unit, → value; list items by number.
        place: of `change` in the study, for messages.

    Raises:
        UserError: a key that the study does not have, or a value that it does not allow.
    """
    if not change:
        return study
    found: dict[KeyPath, Any] = {}
    for written, value in change.items():
        key = study_key(study, registry, written, place)
        found[key.path] = key.parsed(value, written, place)
    return StudySetter(study, registry).study(found)
