"""A store of artifacts as a document: each study's artifacts of each stage, for terminal and JSON."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pliant.formatting import number, plural, seconds
from pliant.report.document import Column, Document, as_json, brief_table
from pliant.store.inventory import StoreEntry, entries

UNKNOWN = "–"


@dataclass(frozen=True)
class Kept:
    """Artifacts of one stage that one study used.

    Attributes:
        study: its name; "–" if no study is known.
        stage: of the work.
        artifacts: their number.
        size_bytes: on the disk.
        newest: time of the last one (ISO 8601, UTC).
        made_s: total time of their computation.
    """

    study: str
    stage: str
    artifacts: int
    size_bytes: int
    newest: str
    made_s: float


COLUMNS: tuple[Column[Kept], ...] = (
    Column("study", brief="study"),
    Column("stage", brief="stage"),
    Column("artifacts", brief="artifacts"),
    Column("size_bytes", brief="MB", show=lambda size: number(size / 1e6, 3)),
    Column("made_s", brief="made in", show=seconds),
    Column("newest", brief="newest"),
)


def store_document(root: Path) -> Document:
    """Return the document of `pliant store`; raises `UserError` where there is no such folder."""
    found = entries(root)
    by_stage = {
        stage: [one for one in found if one.stage == stage] for stage in sorted({e.stage for e in found})
    }
    stages = [_kept("", stage, of_stage) for stage, of_stage in by_stage.items()]
    by_study = list(_by_study(by_stage))
    size = sum(one.size_bytes for one in found)
    count = f"{plural(len(found), 'artifact')} of {plural(len(stages), 'stage')}"
    text = f"{root} holds {count}, {number(size / 1e6, 3)} MB."
    return Document(
        kind="Pliant store",
        title=str(root),
        sentence=text,
        data={
            "root": str(root),
            "stages": [{k: v for k, v in as_json(COLUMNS, one).items() if k != "study"} for one in stages],
            "studies": [as_json(COLUMNS, one) for one in by_study],
            "artifacts": [as_data(one) for one in found],
            "size_bytes": size,
        },
        brief=(brief_table(COLUMNS, by_study),) if by_study else (),
    )


def as_data(entry: StoreEntry) -> dict[str, Any]:
    """Return an artifact as JSON values."""
    return {
        "stage": entry.stage,
        "key": entry.key,
        "studies": list(entry.studies),
        "size_bytes": entry.size_bytes,
        "created": entry.created,
        "wall_s": entry.wall_s,
    }


def _by_study(by_stage: dict[str, list[StoreEntry]]) -> Iterator[Kept]:
    """Yield the rows by study; artifacts that several studies used are in a row of each."""
    names = {study for found in by_stage.values() for one in found for study in one.studies}
    for study in (*sorted(names), UNKNOWN):
        for stage, found in by_stage.items():
            own = [one for one in found if study in (one.studies or (UNKNOWN,))]
            if own:
                yield _kept(study, stage, own)


def _kept(study: str, stage: str, entries: Sequence[StoreEntry]) -> Kept:
    return Kept(
        study,
        stage,
        len(entries),
        sum(one.size_bytes for one in entries),
        max(one.created for one in entries),
        sum(_finite(one.wall_s for one in entries)),
    )


def _finite(values: Iterable[float]) -> Iterator[float]:
    return (value for value in values if math.isfinite(value))
