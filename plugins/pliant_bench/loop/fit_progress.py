"""Progress of diagnoses and of an improvement: completed fits, and a lower bound of the remaining time."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

DIAGNOSING, IMPROVING = "diagnosing", "improving"
TITLES = {DIAGNOSING: "diagnosing", IMPROVING: "improving the model"}

# Seconds between two updates of the file that the live view reads.
EVERY_S = 0.5


@dataclass
class FitProgress:
    """A count of fits, one diagnosis after the other.

    How many diagnoses an improvement needs, and how many fits a diagnosis, is known only in the end: the number is that
    of the diagnosis before, and the remaining time is a lower bound.

    Attributes:
        doing: what the fits are for.
        fits: expected number in each diagnosis.
        diagnoses: expected number of diagnoses, at least.
        each_s: duration of a fit in the diagnosis before, which counts as much as `fits` new ones; 0 if unknown.
        publish: called after each fit.
    """

    doing: str
    fits: int
    diagnoses: int = 1
    each_s: float = 0.0
    publish: Callable[[FitProgress], None] = lambda _: None
    clock: Callable[[], float] = time.monotonic
    hypothesis: str = ""
    diagnosis: int = 1
    done: int = 0
    before: int = 0
    began_s: float = 0.0
    published_s: float = -math.inf
    known: int = 0

    def __post_init__(self) -> None:
        self.began_s, self.known = self.clock(), self.fits if self.each_s else 0

    def tick(self, hypothesis: str) -> None:
        """Count a fit; each diagnosis begins with "nothing"."""
        if hypothesis == "nothing" and self.done:
            self.before, self.fits, self.done = self.before + self.done, self.done, 0
            self.diagnosis += 1
            self.diagnoses = max(self.diagnoses, self.diagnosis)
        self.done, self.hypothesis = self.done + 1, hypothesis
        self.fits = max(self.fits, self.done)
        self.publish(self)

    def is_due(self) -> bool:
        """Return whether it was not written to disk within the last half second."""
        if self.clock() - self.published_s < EVERY_S:
            return False
        self.published_s = self.clock()
        return True

    @property
    def passed_s(self) -> float:
        """Return the time since the beginning."""
        return self.clock() - self.began_s

    @property
    def left_s(self) -> float:
        """Return the time that the expected fits still take, at least."""
        each = (self.known * self.each_s + self.passed_s) / max(self.known + self.before + self.done, 1)
        return each * (self.fits - self.done + (self.diagnoses - self.diagnosis) * self.fits)

    @property
    def words(self) -> str:
        """Return where it is, in one line."""
        said = [TITLES[self.doing]]
        if self.doing == IMPROVING:
            said.append(f"diagnosis {self.diagnosis} of at least {self.diagnoses}")
        said += [
            f"fit {self.done} of about {self.fits} ({self.hypothesis})",
            f"{duration(self.passed_s)} so far",
        ]
        said.append(
            f"at least {duration(self.left_s)} left" if self.left_s >= 1.0 else "longer than expected"
        )
        return ", ".join(said)

    def status(self) -> dict[str, Any]:
        """Return it for the live view."""
        return {"share": self.share, "words": self.words}

    @property
    def share(self) -> float:
        """Return the share of the expected fits that is done."""
        done = (self.diagnosis - 1) * self.fits + self.done
        return done / max(self.diagnoses * self.fits, 1)


def duration(seconds: float) -> str:
    """Return a duration with two digits: ``45 s``, ``2.5 min``."""
    return f"{seconds:.0f} s" if seconds < 100.0 else f"{seconds / 60.0:.2g} min"
