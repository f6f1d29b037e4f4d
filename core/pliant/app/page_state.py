"""What a session of the evidence page has chosen, as JSON values: the only thing that a restart needs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

Effects = tuple[Mapping[str, Any], ...]
# The steps that undo reaches.
MOST_STEPS = 200


@dataclass(frozen=True)
class PageStep:
    """One model on the way.

    Attributes:
        words: what was done.
        effects: all effects of the model in their order, as SI values by field, `kind` first.
        off: runs whose readings are switched off.
        result: key of the fit or of the improvement that its values come from; empty where a hand set them.
        data: recordings that it looks at instead of those that the study names.
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
        data: paths of recordings instead of those that the study names; the present step's.
        steps: every model, the study as it is first; empty before a study is open.
        cursor: the step that is looked at; those behind it were undone.
        pending: work that was asked for and has not ended, so that a restart takes it up.
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
        """The model that is looked at."""
        return self.steps[self.cursor] if self.steps else PageStep("", ())

    def with_step(self, step: PageStep) -> PageState:
        """The step added behind the present one; what was undone is gone. The same model again is no step."""
        now = self.now
        if self.steps and replace(step, words=now.words) == now:
            return self
        kept = (*self.steps[: self.cursor + 1], step)
        if len(kept) > MOST_STEPS:
            kept = (kept[0], *kept[-MOST_STEPS + 1 :])
        return replace(self, steps=kept, cursor=len(kept) - 1, data=step.data)

    def at(self, cursor: int) -> PageState:
        """Looking at another step."""
        if not self.steps:
            return self
        at = min(max(cursor, 0), len(self.steps) - 1)
        return replace(self, cursor=at, data=self.steps[at].data)

    def changed(self) -> PageState:
        """The next version."""
        return replace(self, version=self.version + 1)

    def as_json(self) -> dict[str, Any]:
        """Plain values."""
        return asdict(self)

    @staticmethod
    def from_json(values: Mapping[str, Any]) -> PageState:
        """What `as_json` gave, read again."""
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
    """Effects as JSON gives them, made plain."""
    return tuple(dict(one) for one in values)
