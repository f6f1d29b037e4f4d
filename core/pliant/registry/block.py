"""Blocks of a study in manifests: a key of the study file and the model of its value."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from pliant.registry.manifests import registered
from pliant.registry.place import imported, is_place

KEY = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")
# Keys of a study that are no blocks.
RESERVED = ("pliant", "plugins", "name", "extends", "law_error", "kind")


@dataclass(frozen=True)
class Block:
    """A key of the study file.

    Its value has either a fixed model, or the config model of the component that its `kind` names.

    Attributes:
        key: as a study file has it, `search`.
        model: "module:Class", a subclass of `FrozenModel`; "" for a block with an interface.
        interface: the interface of the component that `kind` names; "" for a block with a model.
        many: whether the value is a list of such blocks.
        description: one line for the JSON schema.
        paths: keys inside the block whose values are paths, relative to the study file.
        reader: the only verb that reads it; the other verbs note that they do not. "" for a block of the model.
        fixed: why no variable or condition of a search sets a key in it; "" if one may.
        check: "module:function", called as `check(study, registry, where)` after the study has been validated, if the
            study has the block; it raises `UserError`, with the line `where(path)`.
        settings: "module:function", called as `settings(value, change)` to change the paths in values that the block
            sets for other keys of the study.
        unused: "module:function", called as `unused(study)` if the study has the block; it returns keys that no
            stage of a run reads: its own, or those that it replaces.
        package: name and version of the distribution; filled by `blocks`.
    """

    key: str
    model: str = ""
    interface: str = ""
    many: bool = False
    description: str = ""
    paths: tuple[str, ...] = ()
    reader: str = ""
    fixed: str = ""
    check: str = ""
    settings: str = ""
    unused: str = ""
    package: str = ""

    @property
    def name(self) -> str:
        """The key."""
        return self.key

    @property
    def label(self) -> str:
        """The name in messages."""
        return f"study block '{self.key}'"

    def problem(self) -> str | None:
        """Return an error in this entry, or None, without importing anything."""
        if not (isinstance(self.key, str) and KEY.fullmatch(self.key)):
            return f"a study block has key {self.key!r}; write lower-case words joined by '_'"
        if self.key in RESERVED:
            return f"{self.label}: the key is Pliant's own; choose another one"
        if bool(self.model) == bool(self.interface):
            return f"{self.label} needs either a model or an interface"
        for name in ("model", "check", "settings", "unused"):
            place = getattr(self, name)
            if place and not is_place(place):
                return f"{self.label} has {name} {place!r}; write it as 'package.module:name'"
        return None

    def model_class(self) -> Any:
        """Import the model of a block without an interface."""
        return imported(self.model)

    def function(self, name: str) -> Callable[..., Any] | None:
        """Import the function `check` or `settings`; None where the block has none."""
        place = getattr(self, name)
        return imported(place) if place else None


def blocks() -> Mapping[str, Block]:
    """Return the blocks of a study of all packages by key, in the order of the study file."""
    return registered("pliant_blocks", Block)


def kind_blocks() -> dict[str, str]:
    """Return the interface of each block whose `kind` names one component."""
    return {key: block.interface for key, block in blocks().items() if block.interface and not block.many}


def kind_lists() -> dict[str, str]:
    """Return the interface of each list of blocks whose `kind` names a component."""
    return {key: block.interface for key, block in blocks().items() if block.interface and block.many}
