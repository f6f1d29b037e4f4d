"""Stored records in manifests: the dataclasses that the artifact store writes and reads."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from pliant.registry.manifests import registered
from pliant.registry.place import is_place


@dataclass(frozen=True)
class StoredRecord:
    """A dataclass that the store may hold; artifacts name it by its class name.

    Attributes:
        place: "module:Class"; imported when an artifact with such a record is read.
        package: name and version of the distribution; filled by `stored_records`.
    """

    place: str
    package: str = ""

    @property
    def name(self) -> str:
        """The name of the class, as artifacts have it."""
        return self.place.partition(":")[2]

    @property
    def label(self) -> str:
        """The name in messages."""
        return f"stored record '{self.name}'"

    def problem(self) -> str | None:
        """Return an error in this entry, or None, without importing anything."""
        if not is_place(self.place):
            return f"a stored record has place {self.place!r}; write 'package.module:Class'"
        return None


def stored_records() -> Mapping[str, StoredRecord]:
    """Return the records that the store may hold, of all packages, by name."""
    return registered("pliant_records", StoredRecord)
