"""A mistake of the record as it is told, and a correction of it as it is tried."""

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
    """What is probably written down wrongly.

    Attributes:
        kind: unit, sign, exchanged (columns), orientation (of the base or of the camera), gravity, payload, clock, or
            rest_pose (the model and the recording disagree before anything is driven).
        where: columns of the file by their headings, or keys of the study.
        words: what was noticed, a sentence with numbers.
        remedy: what to write or to look at, a sentence.
        error_before, error_after: root mean square error at equilibrium as a share of the spread of the readings, as
            the record stands and with the correction; of the readings at rest for `rest_pose`, in noise floors.
    """

    kind: MistakeKind
    where: tuple[str, ...]
    words: str
    remedy: str
    error_before: float
    error_after: float

    @property
    def sentence(self) -> str:
        """What was noticed and what to do, one after the other."""
        return f"{self.words} {self.remedy}"


@dataclass(frozen=True, eq=False)
class Correction:
    """Another reading of the record: what it would mean, and what would have to be written.

    Attributes:
        kind, where, words, remedy: as in `Mistake`; `words` without the numbers.
        inputs: of a history as recorded, the corrected one; None where inputs stay.
        readings: of the readings by name (N,), the corrected ones; None where they stay.
        model: of the model, the corrected one; None where it stays.
        drive: factor on every input that it means; 1 where it is about something else.
        of_load: name of the load that it is about: only samples with that load can tell; empty for all samples.
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
        """Whether the model has to be solved again to judge it."""
        return self.inputs is not None or self.model is not None


def applied_to(readings: ReadingsByName, corrections: Sequence[Correction]) -> ReadingsByName:
    """Return the readings after all corrections of readings, in their order."""
    for one in corrections:
        if one.readings is not None:
            readings = one.readings(readings)
    return readings
