"""Kinds of measured data in manifests that `pliant compare` and `pliant diagnose` take in place of readings."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from pliant.registry.block import KEY
from pliant.registry.manifests import registered
from pliant.registry.place import imported, is_place


class MeasuredData(Protocol):
    """Data of such a kind together with the study that they belong to."""

    @property
    def source(self) -> str:
        """The file's name."""

    @property
    def sha256(self) -> str:
        """The digest of the file's content."""

    def compare(self, context: Any, workers: Any) -> tuple[Any, Callable[[], Any]]:
        """Return the record of the comparison with the model, and the call that returns its `Document`."""

    def candidates(self, registry: Any, kinds: Sequence[str] | None) -> Any:
        """Return what may explain the data, of these kinds of effects or all; raise `UserError` without any."""

    def diagnose(self, context: Any, candidates: Any, workers: Any) -> tuple[Any, Callable[[], Any]]:
        """Return the record of the diagnosis, and the call that returns its `Document`."""


@dataclass(frozen=True)
class DataKind:
    """A kind of measured data besides readings.

    Attributes:
        name: of the kind, `counts`.
        recognises: "module:function", called as `recognises(study, data)` with the data that a user gave in place of
            the study's, or None; it returns whether they are of this kind. Its module should import little.
        open: "module:function", called in the same way for data of this kind; it returns a `MeasuredData`.
        package: name and version of the distribution; filled by `registered`.
    """

    name: str
    recognises: str
    open: str
    package: str = ""

    @property
    def label(self) -> str:
        """The name in messages."""
        return f"kind of data '{self.name}'"

    def problem(self) -> str | None:
        """Return an error in this entry, or None, without importing anything."""
        if not (isinstance(self.name, str) and KEY.fullmatch(self.name)):
            return f"a kind of data has name {self.name!r}; write lower-case words joined by '_'"
        for field in ("recognises", "open"):
            place = getattr(self, field)
            if not is_place(place):
                return f"{self.label} has {field} {place!r}; write it as 'package.module:function'"
        return None


def data_kinds() -> Mapping[str, DataKind]:
    """Return the kinds of data of all packages by name."""
    return registered("pliant_data", DataKind)


def open_data(study: Any, data: Any = None) -> MeasuredData | None:
    """Return the study's data, or `data`, as those of the kind that recognises them; None for readings."""
    for kind in data_kinds().values():
        if imported(kind.recognises)(study, data):
            opened: MeasuredData = imported(kind.open)(study, data)
            return opened
    return None
