"""Results of the checks of a study's numbers, for `doctor`, `run`, `simulate` and the page."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

Status = Literal["doubtful", "fine", "not checked"]


@dataclass(frozen=True)
class Check:
    """One checked subject with its status."""

    subject: str
    status: Status
    sentence: str


# A run leaves this to `pliant doctor` if its task took long.
NOT_SETTLED = Check(
    "rest pose", "not checked", "The chain's pose without actuation was not simulated, to save its time."
)


@dataclass(frozen=True)
class DefaultThatMatters:
    """A default of the study that affects the result.

    Attributes:
        key: as a study writes it: `physics.drag_1`.
        value: the default, SI.
        unit: its SI unit.
        metric: the metric that changes most, in units of its error bar, if the default is a tenth larger.
        change: of the metric, as a share of it, or of the chain's length for a length.
        error_bar: of the metric, as the same share.
    """

    key: str
    value: float
    unit: str
    metric: str
    change: float
    error_bar: float


@dataclass(frozen=True)
class DefaultNotChecked:
    """A default whose sensitivity is not known, and why; `too_long` if more time would determine it."""

    key: str
    why: str
    too_long: bool = False


@dataclass(frozen=True)
class SelfCheck:
    """All checks of a study, the defaults that matter, the strongest first, and those not checked."""

    checks: tuple[Check, ...]
    defaults: tuple[DefaultThatMatters, ...] = ()
    not_checked: tuple[DefaultNotChecked, ...] = ()

    @property
    def doubts(self) -> tuple[Check, ...]:
        """The checks with the status "doubtful"."""
        return tuple(check for check in self.checks if check.status == "doubtful")


def doubtful(subject: str, sentences: Iterable[str]) -> list[Check]:
    """Return a doubt for each sentence."""
    return [Check(subject, "doubtful", sentence) for sentence in sentences]
