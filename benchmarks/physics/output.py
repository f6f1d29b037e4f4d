"""What the physics benchmarks share: bars with the number reached, ratios of times, JSON files."""

from __future__ import annotations

import json
import os
import platform
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from pliant.store.store import write_atomically

OUT = Path(__file__).parents[1] / "out"


@dataclass(frozen=True)
class Bar:
    """A figure that was promised, and the one reached."""

    what: str
    reached: float
    bar: float
    unit: str
    at_most: bool

    @property
    def met(self) -> bool:
        return self.reached <= self.bar if self.at_most else self.reached >= self.bar

    def __str__(self) -> str:
        word = "at most" if self.at_most else "at least"
        verdict = "met" if self.met else "MISSED"
        return f"bar: {self.what}: {self.reached:.3g} {self.unit} ({word} {self.bar:g}): {verdict}"


def ratio(baseline: Sequence[float], other: Sequence[float]) -> float:
    """Median over common rounds of baseline / other: load of the machine hits both alike."""
    return statistics.median(slow / fast for slow, fast in zip(baseline, other, strict=False))


def write(name: str, results: Mapping[str, Any], bars: Sequence[Bar] = ()) -> None:
    """benchmarks/out/NAME.json: results, bars, and the machine that they were measured on."""
    OUT.mkdir(exist_ok=True)
    machine = {"processor": platform.processor() or platform.machine(), "cores": os.cpu_count()}
    document = {**results, "bars": [{**asdict(bar), "met": bar.met} for bar in bars], "machine": machine}
    write_atomically(OUT / f"{name}.json", json.dumps(document, indent=1, default=float))
