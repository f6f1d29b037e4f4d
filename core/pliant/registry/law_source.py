"""Sources of laws in manifests: blocks of a study that give the laws of its families in place of FEM of each design."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from pliant.registry.block import KEY
from pliant.registry.manifests import registered
from pliant.registry.place import is_place


@dataclass(frozen=True)
class LawSource:
    """A block of a study from which the laws of its families come.

    A segment of the chain that states a surrogate does not use it; its law is stated, or fitted to FEM or to a table.

    Attributes:
        block: key of the block, `meta_model`; it has an interface.
        laws: "module:function", called as `laws(context, study, families)`; it returns a `LawStage` for each
            family's config.
        read: "module:function", called as `read(component, value)` with the built component of the block and the value
            of a law's artifact; it returns the law.
        package: name and version of the distribution; filled by `law_sources`.
    """

    block: str
    laws: str
    read: str
    package: str = ""

    @property
    def name(self) -> str:
        """The key of the block."""
        return self.block

    @property
    def label(self) -> str:
        """The name in messages."""
        return f"source of laws '{self.block}'"

    def problem(self) -> str | None:
        """Return an error in this entry, or None, without importing anything."""
        if not (isinstance(self.block, str) and KEY.fullmatch(self.block)):
            return f"a source of laws has block {self.block!r}; write lower-case words joined by '_'"
        for name in ("laws", "read"):
            if not is_place(getattr(self, name)):
                return (
                    f"{self.label} has {name} {getattr(self, name)!r}; write it as 'package.module:function'"
                )
        return None


def law_sources() -> Mapping[str, LawSource]:
    """Return the sources of laws of all packages by the key of their block."""
    return registered("pliant_law_sources", LawSource)
