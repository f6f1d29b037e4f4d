"""Judge the reading of a lab's file: read correctly, refused with a sentence, or read wrongly without a warning."""

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
    """The result of reading a file: the message where it is refused, else a measurement.

    `wrong` states in words which numbers differ from the answer; empty where all agree.
    """

    message: str = ""
    measurement: Measurement | None = None
    wrong: str = ""

    @property
    def remarks(self) -> str:
        return "\n".join(self.measurement.remarks) if self.measurement is not None else ""


def read(lab: LabFile, folder: Path, stated: Mapping[str, Any] | None = None) -> Reading:
    """Write the files and read them unchanged, or with notes for the last of them (for each, of runs)."""
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


def run_columns(measurement: Measurement) -> dict[str, dict[str, Array]]:
    """Return run → column → values, SI."""
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
    """Return the first difference from the answer, or an empty text."""
    found = run_columns(measurement)
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


def judge_reading(lab: LabFile, reading: Reading) -> str:
    """Return right, refused, doubted, or wrong: other numbers without a remark on what may be meant instead.

    Doubted: a remark has the words of the doubt, or the key that would settle it.
    """
    if reading.measurement is None:
        return "refused"
    if not reading.wrong:
        return "right"
    words = lab.doubts or [*lab.stated]
    return "doubted" if words and all(word in reading.remarks for word in words) else "wrong"
