"""Progress on standard error: a bar with rate and estimate on a terminal, a line at the end elsewhere."""

from __future__ import annotations

import time
from datetime import timedelta

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    ProgressColumn,
    TextColumn,
)
from rich.progress import Progress as RichProgress
from rich.progress import Task as RichTask
from rich.text import Text

LINE_EVERY_S = 20.0


class _Rate(ProgressColumn):
    """Steps per second."""

    def render(self, task: RichTask) -> Text:
        speed = task.speed or 0.0
        return Text(f"{speed:.1f}/s" if speed >= 1 else f"{1 / speed:.1f} s each" if speed else "")


class _Left(ProgressColumn):
    """Time left; nothing once an estimated number of steps is used up."""

    def render(self, task: RichTask) -> Text:
        left = None if task.finished else task.time_remaining
        if left is None or left <= 0:
            return Text("")
        return Text(f"{timedelta(seconds=int(left))} left")


class _Bar:
    """A bar on a terminal."""

    def __init__(self, console: Console, title: str, total: int, done: int) -> None:
        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            _Rate(),
            _Left(),
        )
        self.title = title
        self.rich = RichProgress(*columns, console=console, transient=False)
        self.task = self.rich.add_task(title, total=total, completed=done)
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


class _Lines:
    """A line now and then, for logs of batch systems."""

    def __init__(self, console: Console, title: str, total: int, done: int) -> None:
        self.console, self.title, self.total = console, title, total
        self.first, self.done = done, done
        self.within = ""
        self.started = self.said = time.monotonic()
        if done:
            console.print(f"{title}: going on from {done}/{total}")

    def advance(self, steps: int = 1) -> None:
        self.done += steps
        self.total = max(self.total, self.done)
        self._say()

    def describe(self, text: str) -> None:
        self.within = f" ({text})" if text else ""
        self._say()

    def expect(self, total: int) -> None:
        self.total = total

    def _say(self) -> None:
        now = time.monotonic()
        if now - self.said <= LINE_EVERY_S:
            return
        self.said = now
        line = f"{self.title}: {self.done}/{self.total}{self.within}"
        if self.done > self.first:
            each = (now - self.started) / (self.done - self.first)
            line += f", {each:.2f} s each"
            if self.total > self.done:
                line += f", about {each * (self.total - self.done):.0f} s left"
        self.console.print(line)

    def finish(self) -> None:
        elapsed = time.monotonic() - self.started
        self.console.print(f"{self.title}: {self.done}/{self.total} in {elapsed:.1f} s")


class TerminalProgress:
    """`pliant.pipeline.progress.Progress` on standard error."""

    def __init__(self, console: Console, quiet: bool) -> None:
        self.console, self.quiet = console, quiet

    def begin(self, title: str, total: int, done: int = 0) -> _Bar | _Lines | _Nothing:
        if self.quiet:
            return _Nothing()
        if self.console.is_terminal:
            return _Bar(self.console, title, total, done)
        return _Lines(self.console, title, total, done)

    def note(self, text: str) -> None:
        # A corrupted artifact or a skipped engine must be heard even with --quiet.
        self.console.print(f"note: {text}", highlight=False, soft_wrap=True, markup=False)


class _Nothing:
    def advance(self, steps: int = 1) -> None:
        pass

    def describe(self, text: str) -> None:
        pass

    def expect(self, total: int) -> None:
        pass

    def finish(self) -> None:
        pass
