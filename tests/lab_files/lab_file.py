"""A file as a lab writes it, and its answer, written down before any reader was tried.

All files hold (parts of) one recording, `RECORDING`: two runs of a bending finger, sampled at 25 Hz.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Columns = Mapping[str, Array]
SAMPLES, STEP_MS = 61, 40
CLOSE = 1e-9  # of a column's largest magnitude: every number below is written with all of its digits


def _run(cycles: int, largest_pa: float, softer: float) -> dict[str, Array]:
    """Return a run whose numbers have few digits in SI and in the files' units: 10 Pa, 0.01 degrees, 0.01 mm."""
    step = np.arange(SAMPLES)
    pressure = 10.0 * np.round(largest_pa / 10.0 * np.sin(np.pi * cycles * step / (SAMPLES - 1)) ** 2)
    share = pressure / 15_000.0
    degrees = np.round(softer * (52.0 * share - 9.0 * share**2), 2)
    bend = np.radians(degrees)
    return {
        "time_s": step * STEP_MS / 1000.0,
        "pressure_pa": pressure,
        "angle_rad": bend,
        "tip_x_m": np.round(5e3 * np.sin(bend), 2) / 1e5,
        "tip_z_m": np.round(-8e3 * np.cos(bend), 2) / 1e5,
        "elongation_strain": np.round(12.0 * share, 2) / 100.0,
    }


RECORDING: Mapping[str, Mapping[str, Array]] = {
    "slow": _run(1, 15_000.0, 1.0),
    "fast": _run(2, 12_000.0, 1.05),
}


@dataclass(frozen=True)
class LabFile:
    """One way of writing the recording.

    Attributes:
        name: the kind of file.
        files: bytes by file name, in the order in which they are given.
        answer: run → column in SI → expected values; empty where the file is refused in any case.
        stated: notes (the YAML of the file) that the user writes after having been asked or warned.
        refused: words in the one-sentence refusal of the file without `stated`.
        doubts: words in a remark where the file, without `stated`, is read but doubted.
    """

    name: str
    files: Mapping[str, bytes]
    answer: Mapping[str, Columns] = field(default_factory=dict)
    stated: Mapping[str, Any] = field(default_factory=dict)
    refused: Sequence[str] = ()
    doubts: Sequence[str] = ()


def part(*columns: str, runs: Sequence[str] = ("slow",), called: Sequence[str] = ()) -> dict[str, Columns]:
    """Return these columns of these runs of the recording; `called`: names of the runs in the file."""
    return {
        new: {name: RECORDING[run][name] for name in columns}
        for run, new in zip(runs, called or runs, strict=True)
    }


def digits(value: float, decimal: str = ".") -> str:
    """Return a number with its digits, 12 at most."""
    text = f"{value:.12f}".rstrip("0").rstrip(".")
    return ("0" if text in ("", "-0") else text).replace(".", decimal)


def rows(
    *columns: Sequence[float] | Sequence[str] | Array, between: str = ",", decimal: str = "."
) -> list[str]:
    """Return the lines of a table; numbers are written with all their digits."""
    cells = [[c if isinstance(c, str) else digits(float(c), decimal) for c in column] for column in columns]
    return [between.join(row) for row in zip(*cells, strict=True)]


def text(*lines: str, encoding: str = "utf-8", ends: str = "\n") -> bytes:
    """Return lines as the bytes of a file."""
    return (ends.join(lines) + ends).encode(encoding)
