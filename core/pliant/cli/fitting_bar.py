"""Progress of a diagnosis: one bar for each, effects first, then sets of them as the search comes to them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from pliant.cli.session import Session
from pliant.execution.progress import ProgressBar


class FittingBar:
    """`tick` hears of every hypothesis that has been fitted; each diagnosis begins with "nothing"."""

    def __init__(self, here: Session, kinds: int) -> None:
        self._here, self._kinds = here, kinds
        self._task, self._done = self._begun("fitting effects"), 0

    def tick(self, hypothesis: str) -> None:
        """Count a fit. How many sets there will be nobody knows: the bar grows with them and names them."""
        if hypothesis == "nothing" and self._done:
            self.finish()
            self._task, self._done = self._begun("fitting effects again"), 0
        if " + " in hypothesis:
            self._task.expect(self._done + 1)  # effects that the chain cannot have are not fitted
            self._task.describe(hypothesis)
        self._task.advance()
        self._done += 1

    @property
    def fitted(self) -> bool:
        """Whether a hypothesis has been fitted."""
        return self._done > 0

    def finish(self) -> None:
        """End the bar."""
        self._task.expect(self._done)
        self._task.finish()

    def _begun(self, title: str) -> ProgressBar:
        return self._here.progress.begin(title, 1 + self._kinds)


@contextmanager
def fitting_bar(here: Session, kinds: int) -> Iterator[FittingBar]:
    """A bar that ends with the block; of a diagnosis that fails before its first fit nothing is told."""
    bar = FittingBar(here, kinds)
    try:
        yield bar
    except BaseException:
        if bar.fitted:
            bar.finish()
        raise
    bar.finish()
