"""What becomes of a lab's file: read and right, refused with a sentence, or wrong without a word."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from tests.lab_files.lab_file import CLOSE, Array, LabFile

from pliant.errors import UserError
from pliant.measurements.files import read_measurements
from pliant.records.measurement import Measurement


@dataclass(frozen=True)
class Reading:
    """What the reader made of a file: its message where it refused, else a measurement.

    `wrong` says which numbers are not those of the answer, in words; empty where all are.
    """

    message: str = ""
    measurement: Measurement | None = None
    wrong: str = ""

    @property
    def remarks(self) -> str:
        return "\n".join(self.measurement.remarks) if self.measurement is not None else ""


def read(lab: LabFile, folder: Path, stated: Mapping[str, Any] | None = None) -> Reading:
    """Write the files and read them as they are, or with notes beside the last of them (beside each, of runs)."""
    for name, content in lab.files.items():
        (folder / name).write_bytes(content)
        beside = (folder / name).with_suffix(".yaml")
        beside.unlink(missing_ok=True)
        if stated and stated.get("join", {}).get("file") != name:
            beside.write_text(json.dumps(dict(stated)))
    try:
        found = read_measurements([folder / name for name in lab.files])
    except UserError as error:
        return Reading(message=str(error))
    return Reading(measurement=found, wrong=difference(lab.answer, found))


def columns_of(measurement: Measurement) -> dict[str, dict[str, Array]]:
    """Run → column → values, SI."""
    found = {}
    for run in measurement.runs:
        own = {**run.history.actuation, **run.outputs}
        if run.history.time_s is not None:
            own["time_s"] = run.history.time_s
        if run.history.payload_kg is not None:
            own["payload_kg"] = run.history.payload_kg
        found[run.name] = own
    return found


def difference(answer: Mapping[str, Mapping[str, Array]], measurement: Measurement) -> str:
    """The first thing that is not as in the answer, or an empty text."""
    found = columns_of(measurement)
    if list(found) != list(answer):
        return f"runs {list(found)}, not {list(answer)}"
    for run, columns in answer.items():
        if set(found[run]) != set(columns):
            return f"columns {sorted(found[run])}, not {sorted(columns)}"
        for name, values in columns.items():
            own = found[run][name]
            near = CLOSE * max(float(np.nanmax(np.abs(values))), 1e-12)
            if own.shape != values.shape or not np.allclose(own, values, rtol=0, atol=near, equal_nan=True):
                return f"{run}, {name}: {own[:3]}…, not {values[:3]}…"
    return ""


def kind_of(lab: LabFile, reading: Reading) -> str:
    """right, refused, doubted, or wrong: other numbers, and not a word on what may be meant instead.

    Doubted: a remark has the words of the doubt, or the key that would settle it.
    """
    if reading.measurement is None:
        return "refused"
    if not reading.wrong:
        return "right"
    words = lab.doubts or [*lab.stated]
    return "doubted" if words and all(word in reading.remarks for word in words) else "wrong"
