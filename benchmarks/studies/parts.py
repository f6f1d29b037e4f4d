"""Finished parts of a study, a JSON each, so that an interrupted study goes on with what is missing.

A study takes hours, and not everybody has them in one go, or on one checkout: what was published stands in for a part
that this checkout lacks, as long as it is of the same study. What is asked for is always run.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pliant.cli.session import plain
from pliant.config.study import Study
from pliant.pipeline.workbench import content
from pliant.store.store import write_atomically

Part = dict[str, Any]
# What a result has beside its main search.
AROUND = ("small", "overrides", "published", "runs", "baseline", "seeds", "bars")


@dataclass(frozen=True)
class Parts:
    """The parts of a folder.

    Attributes:
        folder: of NAME.json.
        fresh: whether parts that are there are made anew.
        published: parts that docs have, as far as a page needs them.
    """

    folder: Path
    fresh: bool = False
    published: Mapping[str, Part] = field(default_factory=dict)

    def find(self, name: str, of: str) -> Part | None:
        """A finished part, or None: it is missing, or was made of something else than `of`."""
        try:
            part: Part = json.loads((self.folder / f"{name}.json").read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None
        return part if part.get("made_of") == of else None

    def known(self, name: str, of: str) -> Part | None:
        """A finished part, or else the published one; None where neither is of the same study."""
        docs = self.published.get(name, {})
        return self.find(name, of) or (docs if docs.get("made_of") == of else None)

    def get(self, name: str, of: str, make: Callable[[], Mapping[str, Any]]) -> Part:
        """A finished part, made where it is missing."""
        found = None if self.fresh else self.find(name, of)
        if found is not None:
            return found
        self.folder.mkdir(parents=True, exist_ok=True)
        made = {"made_of": of, **plain(make())}
        write_atomically(self.folder / f"{name}.json", json.dumps(made, indent=1, allow_nan=False) + "\n")
        return self.find(name, of) or made


def published_parts(file: Path, main: str) -> dict[str, Part]:
    """Part → what a published result keeps of it; nothing where there is no such file.

    Args:
        file: NAME.json of docs.
        main: the search that the result is of: of it everything is kept.
    """
    try:
        result = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    parts: dict[str, Part] = dict(result["runs"])
    if main in parts:
        whole = {key: value for key, value in result.items() if key not in AROUND}
        parts[main] = {**whole, **parts[main]}
    over_seeds = [part for own in result.get("seeds", {}).values() for part in own]
    others = [result.get("baseline") or {}, *over_seeds]
    return parts | {part["part"]: part for part in others if part}


def made_of(study: Study) -> str:
    """Names what the study says, files that it names by their content: a part of something else is out of date."""
    return hashlib.sha256(json.dumps(content(study), sort_keys=True).encode()).hexdigest()[:32]
