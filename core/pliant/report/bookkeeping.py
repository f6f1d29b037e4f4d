"""Bookkeeping mistakes of a recording in documents: as warnings before everything else, and in JSON."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from pliant.evidence.bookkeeping.mistake import Mistake
from pliant.records.measurement import Measurement
from pliant.records.remark import Rank
from pliant.report.document import Warned


def mistakes_warned(mistakes: Sequence[Mistake]) -> tuple[Warned, ...]:
    """Return a warning for each mistake, of the highest rank."""
    return tuple(Warned(one.sentence, rank=Rank.UNIT) for one in mistakes)


def mistakes_json(mistakes: Sequence[Mistake]) -> list[dict[str, Any]]:
    """Return plain values by the keys of docs/compare.md."""
    return [{**asdict(one), "where": list(one.where)} for one in mistakes]


def not_repeated(
    remarks: Sequence[str], measurement: Measurement, mistakes: Sequence[Mistake]
) -> tuple[str, ...]:
    """Return the remarks without doubts about a unit that the model has resolved for the same column."""
    settled = {column for one in mistakes if one.kind == "unit" for column in one.where}
    doubts = [d.sentence for d in measurement.doubts if d.kind == "unit" and d.column in settled]
    return tuple(text for text in remarks if not any(doubt in text for doubt in doubts))
