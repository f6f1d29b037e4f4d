"""What the page of a search is rebuilt from: the record, the study and the drawn designs, in the folder itself."""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pliant.errors import UserError
from pliant.mechanics.kinematics import ChainGeometry
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.rollout import TaskResult
from pliant.records.search import SearchResult
from pliant.store.store import (
    CorruptedError,
    digests,
    read_checked,
    write_atomically,
    write_value,
    writing_in,
)

DATA = Path("data") / "search_page"
DIGESTS = "digests.json"


@dataclass(frozen=True, eq=False)
class DrawnDesign:
    """A design to draw: its name, its chain (None for a scene), what the task left behind."""

    label: str
    chain: ChainModel | None
    result: TaskResult


@dataclass(frozen=True, eq=False)
class Drawing:
    """A drawn design without what no picture needs; `rest_m` (n + 2, 3) are the markers of the straight chain."""

    label: str
    result: TaskResult
    rest_m: Array | None = None

    @staticmethod
    def of(drawn: DrawnDesign) -> Drawing:
        """Without the recorded motion."""
        rest = None
        if drawn.chain is not None and not drawn.result.stills:
            geometry = ChainGeometry.of(drawn.chain)
            rest = geometry.markers(np.zeros_like(drawn.result.final.joint_angles))
        return Drawing(drawn.label, replace(drawn.result, frames=None, rollout=None), rest)


def is_search(folder: Path) -> bool:
    """Whether a folder holds a finished search."""
    return (folder / DATA / DIGESTS).is_file()


def write_search(
    folder: Path, study: Mapping[str, Any], result: SearchResult, drawn: Sequence[Drawing]
) -> None:
    """Write the record; what an earlier search left is replaced as a whole. Raises `UserError` where it cannot."""
    value = {
        "study": study,
        "result": result,
        "drawn": [{"label": d.label, "result": d.result, "rest_m": d.rest_m} for d in drawn],
    }
    target = folder / DATA
    with writing_in(folder):
        fresh = target.with_name(target.name + ".new")
        shutil.rmtree(fresh, ignore_errors=True)
        fresh.mkdir(parents=True)
        write_value(fresh, value)
        write_atomically(fresh / DIGESTS, json.dumps(digests(fresh)))
        shutil.rmtree(target, ignore_errors=True)
        fresh.rename(target)


def read_search(folder: Path) -> tuple[Mapping[str, Any], SearchResult, tuple[Drawing, ...]]:
    """Study, record and drawings; raises `UserError` where the folder holds none, or a damaged one."""
    try:
        expected = json.loads((folder / DATA / DIGESTS).read_text())
        value = read_checked(folder / DATA, expected)
        drawn = tuple(Drawing(d["label"], d["result"], d["rest_m"]) for d in value["drawn"])
        return value["study"], value["result"], drawn
    except FileNotFoundError:
        raise UserError(f"{folder} holds no finished search; give the folder of 'pliant optimize'.") from None
    except (CorruptedError, OSError, ValueError, KeyError, TypeError) as error:
        raise UserError(f"{folder} is damaged ({error}); run 'pliant optimize' again.") from None
