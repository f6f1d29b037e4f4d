"""What is to be reached, beside what was."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

ROUNDING = 1e-9


@dataclass(frozen=True)
class Bar:
    """A figure to reach.

    Attributes:
        what: in words.
        reached: None: not run.
        bar: the limit, in the unit of `reached`.
        unit: that both are shown in, `scale` times their own.
        at_most: whether less is better.
        published: of the published study, in words; "" where it has none.
    """

    what: str
    reached: float | None
    bar: float
    unit: str
    scale: float = 1.0
    at_most: bool = True
    published: str = ""

    @property
    def met(self) -> bool | None:
        """None where it was not run."""
        if self.reached is None:
            return None
        slack = ROUNDING * max(abs(self.bar), ROUNDING)
        return bool(self.reached <= self.bar + slack if self.at_most else self.reached >= self.bar - slack)

    def shown(self, value: float | None) -> str:
        """A number with its unit."""
        return "not run" if value is None else f"{self.scale * value:.3g} {self.unit}".strip()

    def __str__(self) -> str:
        word = "at most" if self.at_most else "at least"
        verdict = {None: "", True: ": met", False: ": MISSED"}[self.met]
        return f"bar: {self.what}: {self.shown(self.reached)} ({word} {self.shown(self.bar)}){verdict}"

    def json(self) -> dict[str, Any]:
        """As a result keeps it."""
        return {
            "what": self.what, "reached": self.reached, "bar": self.bar, "at_most": self.at_most, "met": self.met,
            "unit": self.unit, "scale": self.scale, "published": self.published,
        }  # fmt: skip


def bar_rows(bars: Sequence[dict[str, Any]]) -> Iterator[str]:
    """The bars of a result as a table."""
    yield "| what | to reach | reached | | published |"
    yield "|---|---|---|---|---|"
    for one in bars:
        bar = Bar(**{name: value for name, value in one.items() if name != "met"})
        sign = "≤" if bar.at_most else "≥"
        verdict = {None: "", True: "met", False: "**missed**"}[bar.met]
        yield (
            f"| {bar.what} | {sign} {bar.shown(bar.bar)} | {bar.shown(bar.reached)} | {verdict} | "
            f"{bar.published or '–'} |"
        )
