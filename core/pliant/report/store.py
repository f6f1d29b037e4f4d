"""A store of artifacts as a document: how much each stage keeps, for terminal and JSON."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from pliant.errors import UserError
from pliant.formatting import number, plural
from pliant.report.document import Column, Document, as_json, brief_table
from pliant.store.store import MANIFEST


@dataclass(frozen=True)
class Kept:
    """Finished artifacts of one stage: how many, their size on the disk, when the newest was made (ISO 8601, UTC)."""

    stage: str
    artifacts: int
    size_bytes: int
    newest: str


COLUMNS: tuple[Column[Kept], ...] = (
    Column("stage", brief="stage"),
    Column("artifacts", brief="artifacts"),
    Column("size_bytes", brief="MB", show=lambda size: number(size / 1e6, 3)),
    Column("newest", brief="newest"),
)


def store_document(root: Path) -> Document:
    """The document of `pliant store`; raises `UserError` where there is no such folder."""
    if not root.is_dir():
        raise UserError(f"there is no store at {root}; the first 'pliant run' makes one, or give --store.")
    stages = list(_stages(root))
    count, size = sum(one.artifacts for one in stages), sum(one.size_bytes for one in stages)
    text = f"{root} holds {plural(count, 'artifact')} of {plural(len(stages), 'stage')}, {number(size / 1e6, 3)} MB."
    return Document(
        kind="Pliant store",
        title=str(root),
        sentence=text,
        data={"root": str(root), "stages": [as_json(COLUMNS, one) for one in stages], "size_bytes": size},
        brief=(brief_table(COLUMNS, stages),) if stages else (),
    )


def _stages(root: Path) -> Iterator[Kept]:
    for stage in sorted(folder for folder in root.iterdir() if folder.is_dir()):
        finished = list(stage.glob(f"*/{MANIFEST}"))
        sizes = [file.stat().st_size for one in finished for file in one.parent.rglob("*") if file.is_file()]
        if finished:
            last = datetime.fromtimestamp(max(one.stat().st_mtime for one in finished), UTC)
            yield Kept(stage.name, len(finished), sum(sizes), last.isoformat(timespec="seconds"))
