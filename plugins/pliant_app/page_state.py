"""The choices of a session of the evidence page, as JSON values: all that a restart needs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

Effects = tuple[Mapping[str, Any], ...]
# Number of steps that undo reaches.
MOST_STEPS = 200


@dataclass(frozen=True)
class PageStep:
    """One model among the steps of a session.

    Attributes:
        words: what was done.
        effects: all effects of the model in their order, as SI values by field, `kind` first.
        off: runs whose readings are switched off.
        result: key of the fit or of the improvement that gave its values; empty for values set by hand.
        data: recordings used instead of those that the study names.
    """

    words: str
    effects: Effects
    off: tuple[str, ...] = ()
    result: str = ""
    data: tuple[str, ...] = ()


@dataclass(frozen=True)
class PageState:
    """Files and steps.

    Attributes:
        study: path of the study; empty where none was chosen.
        data: paths of the present step's recordings, if not those that the study names.
        steps: every model, beginning with the unchanged study; empty before a study is open.
        cursor: the present step; those after it were undone.
        pending: requested work that has not ended, so that a restart resumes it.
        version: counts changes, so that every tab sees them.
    """

    study: str = ""
    data: tuple[str, ...] = ()
    steps: tuple[PageStep, ...] = ()
    cursor: int = 0
    pending: Mapping[str, Any] | None = None
    version: int = 0

    @property
    def now(self) -> PageStep:
        """The present model."""
        return self.steps[self.cursor] if self.steps else PageStep("", ())

    def with_step(self, step: PageStep) -> PageState:
        """Return the state with a step after the present one; undone steps are dropped, an equal model adds none."""
        now = self.now
        if self.steps and replace(step, words=now.words) == now:
            return self
        kept = (*self.steps[: self.cursor + 1], step)
        if len(kept) > MOST_STEPS:
            kept = (kept[0], *kept[-MOST_STEPS + 1 :])
        return replace(self, steps=kept, cursor=len(kept) - 1, data=step.data)

    def at(self, cursor: int) -> PageState:
        """Return the state at another step."""
        if not self.steps:
            return self
        at = min(max(cursor, 0), len(self.steps) - 1)
        return replace(self, cursor=at, data=self.steps[at].data)

    def changed(self) -> PageState:
        """Return the next version."""
        return replace(self, version=self.version + 1)

    def as_json(self) -> dict[str, Any]:
        """Return plain values."""
        return asdict(self)

    @staticmethod
    def from_json(values: Mapping[str, Any]) -> PageState:
        """Return the state that `as_json` wrote."""
        steps = tuple(
            PageStep(
                one["words"],
                as_effects(one["effects"]),
                tuple(one["off"]),
                one["result"],
                tuple(one.get("data", values["data"])),
            )
            for one in values["steps"]
        )
        return PageState(
            str(values["study"]),
            tuple(values["data"]),
            steps,
            int(values["cursor"]),
            values["pending"],
            int(values["version"]),
        )


def as_effects(values: Sequence[Mapping[str, Any]]) -> Effects:
    """Return effects from JSON as plain values."""
    return tuple(dict(one) for one in values)
