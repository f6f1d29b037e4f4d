"""Places where the keys of a study or of notes were written, for messages after reading."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

KEY = re.compile(
    r"(?<![\w./-])([a-z_]+(?:\.\w+)+|(?<=')[a-z_]+(?=[':]))"
)  # chain.actuators, 'effects', 'reach: x'

ITEM = re.compile(r"(?<=\w)\[(\d+)\]")  # protocols[0]


class Places:
    """Place of each key path: "first.yaml, line 5", or an override. Objects that differ only in places are equal."""

    def __init__(self, of_keys: Mapping[tuple[Any, ...], str] | None = None, study: str = "") -> None:
        """Keep the places; `study`: name of the opened file, which may extend others; "" for notes."""
        self.of_keys, self.study = dict(of_keys or {}), study

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Places)

    def __hash__(self) -> int:
        return hash(Places)

    def below(self, key: str) -> Places:
        """Return the places of a block's keys."""
        inner = {path[1:]: place for path, place in self.of_keys.items() if path[:1] == (key,)}
        return Places(inner, self.study)

    @property
    def files(self) -> set[str]:
        """Return the files that state keys, without overrides of the command line."""
        return {
            file for place in self.of_keys.values() for file, line, _ in [place.partition(", line ")] if line
        }

    def located(self, message: str) -> str:
        """Return a message preceded by the place of the first key that it names.

        The message is unchanged if all keys are in one file, which the user has named, or if it names one of the files.
        """
        files = self.files
        if len(files) < 2 or any(Path(file).name in message for file in files):
            return message
        for word in KEY.findall(ITEM.sub(r".\1", message)):
            path = tuple(int(part) if part.isdigit() else part for part in word.split("."))
            whole = (
                path[:-1] if path not in self.of_keys and isinstance(path[-1], int) else path
            )  # the list of an item
            if ", line " in (place := self.of_keys.get(whole, "")):
                return f"{place}: {message}"
        return message
