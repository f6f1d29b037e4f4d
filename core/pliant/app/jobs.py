"""One piece of long work at a time, in a thread, with progress and stop."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from pliant.app.open_model import StoppedError
from pliant.errors import PliantError, UserError


@dataclass
class Job:
    """What runs.

    Attributes:
        what: fit, diagnose, improve or describe.
        key: of its result.
        words: what is under way within it.
        done: hypotheses that were fitted.
    """

    what: str
    key: str
    words: str = ""
    done: int = 0
    began: float = field(default_factory=time.monotonic)
    stop: threading.Event = field(default_factory=threading.Event)
    _stage: tuple[str, int, int] = ("", 0, 0)

    def tick(self, hypothesis: str) -> None:
        """A hypothesis was fitted; raises `StoppedError` once the job shall stop."""
        self.words = hypothesis
        self.done += 1
        if self.stop.is_set():
            raise StoppedError

    # As `Progress` of stages and as its bar, so that what solves states is watched and can be stopped between two.

    def begin(self, title: str, total: int, done: int = 0) -> Job:
        """A stage begins some steps."""
        self._stage = (title, total, done)
        self.advance(0)
        return self

    def advance(self, steps: int = 1) -> None:
        """Some are done; raises `StoppedError` once the job shall stop."""
        title, total, done = self._stage
        self._stage = (title, max(total, done + steps), done + steps)
        self.words = f"{title}: {done + steps} of about {self._stage[1]}"
        if self.stop.is_set():
            raise StoppedError

    def expect(self, total: int) -> None:
        """The number of steps is now thought to be another one."""
        self._stage = (self._stage[0], total, self._stage[2])

    def describe(self, text: str) -> None:
        """What is under way within a step is not shown."""

    def finish(self) -> None:
        """The stage ended."""

    def note(self, text: str) -> None:
        """Remarks of stages stand in reports."""

    def as_json(self) -> dict[str, Any]:
        """For the page."""
        return {
            "what": self.what,
            "key": self.key,
            "words": self.words,
            "done": self.done,
            "seconds": round(time.monotonic() - self.began, 1),
            "stopping": self.stop.is_set(),
        }


class Bench:
    """Runs one job at a time."""

    def __init__(self) -> None:
        self.job: Job | None = None
        self._thread: threading.Thread | None = None
        self._lock = threading.Lock()

    def begin(self, job: Job, work: Callable[[Job], None], ended: Callable[[Job, str], None]) -> None:
        """Begin the work of a job; `ended` is told a sentence where it did not succeed, else an empty one.

        Raises:
            UserError: another one is under way.
        """
        with self._lock:
            if self.job is not None:
                if self.job.key == job.key:
                    return
                raise UserError(f"'{self.job.what}' is under way; stop it first, or wait.")
            self.job = job
        self._thread = threading.Thread(target=self._run, args=(job, work, ended), daemon=True)
        self._thread.start()

    def _run(self, job: Job, work: Callable[[Job], None], ended: Callable[[Job, str], None]) -> None:
        said = ""
        try:
            work(job)
        except StoppedError:
            kept = "what was solved is kept" if job.what == "describe" else "nothing of the model changed"
            said = f"'{job.what}' was stopped; {kept}."
        except PliantError as error:
            said = str(error)
        except Exception as error:  # the page says it instead of a dead thread
            said = f"'{job.what}' failed: {type(error).__name__}: {error}"
        finally:
            self.job = None
            ended(job, said)

    def stop(self) -> None:
        """Ask the job to stop."""
        if self.job is not None:
            self.job.stop.set()

    def wait(self, seconds: float = 600.0) -> None:
        """Until no job runs."""
        if self._thread is not None:
            self._thread.join(seconds)
