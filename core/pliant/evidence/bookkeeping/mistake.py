"""Records of a bookkeeping mistake as reported, and of a correction as tried."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from pliant.interfaces.effect import Model
from pliant.records.design import Array
from pliant.records.history import History

MistakeKind = Literal["unit", "sign", "exchanged", "orientation", "gravity", "payload", "clock", "rest_pose"]
ReadingsByName = Mapping[str, Array]


@dataclass(frozen=True)
class Mistake:
    """A probable bookkeeping mistake.

    Attributes:
        kind: unit, sign, exchanged (columns), orientation (of the base or of the camera), gravity, payload, clock, or
            rest_pose (the model and the recording disagree before anything is driven).
        where: columns of the file by their headings, or keys of the study.
        words: what was noticed, a sentence with numbers.
        remedy: what to write or to look at, a sentence.
        error_before, error_after: root mean square error at equilibrium as a share of the spread of the readings,
            without and with the correction; for `rest_pose` of the readings at rest, in noise floors.
    """

    kind: MistakeKind
    where: tuple[str, ...]
    words: str
    remedy: str
    error_before: float
    error_after: float

    @property
    def sentence(self) -> str:
        """Return the finding followed by the remedy."""
        return f"{self.words} {self.remedy}"


@dataclass(frozen=True, eq=False)
class Correction:
    """An alternative meaning of the record: what it implies, and what would have to be written.

    Attributes:
        kind, where, words, remedy: as in `Mistake`; `words` without the numbers.
        inputs: maps a history as recorded to the corrected one; None where inputs stay.
        readings: maps the readings by name (N,) to the corrected ones; None where they stay.
        model: maps the model to the corrected one; None where it stays.
        drive: factor on every input that it implies; 1 where it does not concern the inputs.
        of_load: name of the load that it concerns: only samples with that load count; empty for all samples.
    """

    kind: MistakeKind
    where: tuple[str, ...]
    words: str
    remedy: str
    inputs: Callable[[History], History] | None = None
    readings: Callable[[ReadingsByName], ReadingsByName] | None = None
    model: Callable[[Model], Model] | None = None
    drive: float = 1.0
    of_load: str = ""

    @property
    def simulated(self) -> bool:
        """Return whether judging it requires solving the model again."""
        return self.inputs is not None or self.model is not None


def applied_to(readings: ReadingsByName, corrections: Sequence[Correction]) -> ReadingsByName:
    """Return the readings after all corrections of readings, in their order."""
    for one in corrections:
        if one.readings is not None:
            readings = one.readings(readings)
    return readings
