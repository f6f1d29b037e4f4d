"""Progress on standard error: a bar with rate and estimated time on a terminal, one final line elsewhere."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from datetime import timedelta
from functools import partial

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, ProgressColumn, TextColumn
from rich.progress import Progress as RichProgress
from rich.progress import Task as RichTask
from rich.text import Text

from pliant.errors import brief
from pliant.execution.progress import LogBar, Progress, ProgressBar, Silent


class _Rate(ProgressColumn):
    """Steps per second."""

    def render(self, task: RichTask) -> Text:
        speed = task.speed or 0.0
        return Text(f"{speed:.1f}/s" if speed >= 1 else f"{1 / speed:.1f} s each" if speed else "")


class _Left(ProgressColumn):
    """Remaining time; empty once the estimated number of steps is exceeded."""

    def render(self, task: RichTask) -> Text:
        left = None if task.finished else task.time_remaining
        if left is None or left <= 0:
            return Text("")
        return Text(f"{timedelta(seconds=int(left))} left")


class _Bar:
    """A bar on a terminal."""

    def __init__(self, console: Console, title: str, total: int, done: int) -> None:
        columns = (
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            MofNCompleteColumn(),
            _Rate(),
            _Left(),
        )
        self.title = title
        self.rich = RichProgress(*columns, console=console, transient=False)
        self.task = self.rich.add_task(title, total=total or None, completed=done)
        self.rich.start()

    def advance(self, steps: int = 1) -> None:
        self.rich.advance(self.task, steps)
        task = self.rich.tasks[0]
        if task.total is not None and task.completed > task.total:
            self.rich.update(self.task, total=task.completed)

    def describe(self, text: str) -> None:
        self.rich.update(self.task, description=f"{self.title} ({text})" if text else self.title)

    def expect(self, total: int) -> None:
        self.rich.update(self.task, total=total)

    def finish(self) -> None:
        self.rich.stop()


class TerminalProgress:
    """`pliant.execution.progress.Progress` on standard error."""

    def __init__(self, console: Console, quiet: bool) -> None:
        self.console, self.quiet = console, quiet

    def begin(self, title: str, total: int, done: int = 0) -> ProgressBar:
        if self.quiet:
            return Silent()
        if self.console.is_terminal:
            return _Bar(self.console, title, total, done)
        return LogBar(partial(self.console.print, markup=False), title, total, done)

    def note(self, text: str) -> None:
        # A corrupted artifact or a skipped engine is reported even with --quiet.
        self.console.print(f"note: {brief(text)}", highlight=False, soft_wrap=True, markup=False)


class FittingBar:
    """Progress of diagnoses: one bar for single effects and one for sets of effects, whose number is not known."""

    def __init__(self, progress: Progress, kinds: int) -> None:
        self._progress, self._kinds, self._again, self._sets = progress, kinds, "", False
        self._begin("fitting effects", 1 + kinds)

    def _begin(self, title: str, total: int) -> None:
        self._task, self._done = self._progress.begin(f"{title}{self._again}", total), 0

    def tick(self, hypothesis: str) -> None:
        """Count a fit; each diagnosis begins with "nothing"."""
        if hypothesis == "nothing" and self._done:
            self.finish()
            self._again, self._sets = " again", False
            self._begin("fitting effects", 1 + self._kinds)
        if " + " in hypothesis and not self._sets:
            self.finish()
            self._sets = True
            self._begin("fitting sets of effects", 0)
        if self._sets:
            self._task.describe(hypothesis)
        self._task.advance()
        self._done += 1

    def finish(self) -> None:
        """End the bar; effects that the chain cannot have were not fitted."""
        self._task.expect(self._done)
        self._task.finish()


@contextmanager
def fitting_bar(progress: Progress, kinds: int) -> Iterator[FittingBar]:
    """Yield a bar that ends with the block; a diagnosis that fails before its first fit prints nothing."""
    bar = FittingBar(progress, kinds)
    try:
        yield bar
    except BaseException:
        if bar._done:
            bar.finish()
        raise
    bar.finish()
