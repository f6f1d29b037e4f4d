"""Long work in a thread, one job at a time, with progress and stop."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from pliant.errors import PliantError, UserError
from pliant_app.open_model import StoppedError


@dataclass
class Job:
    """The running work.

    Attributes:
        what: fit, diagnose, improve or describe.
        key: of its result.
        words: description of its present stage.
        done: number of fitted hypotheses.
    """

    what: str
    key: str
    words: str = ""
    done: int = 0
    began: float = field(default_factory=time.monotonic)
    stop: threading.Event = field(default_factory=threading.Event)
    _stage: tuple[str, int, int] = ("", 0, 0)

    def tick(self, hypothesis: str) -> None:
        """Count a fitted hypothesis; raises `StoppedError` after a stop was requested."""
        self.words = hypothesis
        self.done += 1
        if self.stop.is_set():
            raise StoppedError

    # Implements `Progress` and its bar, so that stages that solve states are shown and can be stopped between states.

    def begin(self, title: str, total: int, done: int = 0) -> Job:
        """Begin a stage of some steps."""
        self._stage = (title, total, done)
        self.advance(0)
        return self

    def advance(self, steps: int = 1) -> None:
        """Count finished steps; raises `StoppedError` after a stop was requested."""
        title, total, done = self._stage
        self._stage = (title, max(total, done + steps), done + steps)
        self.words = f"{title}: {done + steps} of about {self._stage[1]}"
        if self.stop.is_set():
            raise StoppedError

    def expect(self, total: int) -> None:
        """Set the expected number of steps."""
        self._stage = (self._stage[0], total, self._stage[2])

    def describe(self, text: str) -> None:
        """Ignore the description of a step."""

    def finish(self) -> None:
        """End the stage."""

    def note(self, text: str) -> None:
        """Ignore remarks of stages, which reports show."""

    def as_json(self) -> dict[str, Any]:
        """Return the JSON values for the page."""
        return {
            "what": self.what,
            "key": self.key,
            "words": self.words,
            "done": self.done,
            "seconds": round(time.monotonic() - self.began, 1),
            "stopping": self.stop.is_set(),
        }


class JobRunner:
    """A runner of one job at a time."""

    def __init__(self) -> None:
        self.job: Job | None = None
        self._thread: threading.Thread | None = None
        self._lock = threading.Lock()

    def begin(self, job: Job, work: Callable[[Job], None], ended: Callable[[Job, str], None]) -> None:
        """Begin the work of a job; `ended` receives a sentence on a failure, else an empty one.

        Raises:
            UserError: another job is running.
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
        except Exception as error:  # reported on the page, instead of a dead thread
            said = f"'{job.what}' failed: {type(error).__name__}: {error}"
        finally:
            self.job = None
            ended(job, said)

    def stop(self) -> None:
        """Ask the job to stop."""
        if self.job is not None:
            self.job.stop.set()

    def wait(self, seconds: float = 600.0) -> None:
        """Wait until no job runs."""
        if self._thread is not None:
            self._thread.join(seconds)
