"""Progress of jobs on any host: a folder in the artifact store with a small file for each job.

A worker that finds the folder shares the store. The folder is removed when the work ends; the folder of a killed driver
is recognised by its lock, which the operating system released, and is removed by the next driver.
"""

from __future__ import annotations

import shutil
import uuid
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from filelock import FileLock, Timeout

from pliant.errors import UserError

FOLDER = "sweeps"
LOCK = "lock"


class ProgressStore:
    """The driver's view of the folder: a file `done total` for each job that has begun."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def clear(self, number: int) -> None:
        """Delete the progress of a job."""
        (self.folder / str(number)).unlink(missing_ok=True)

    def began(self, number: int) -> bool:
        """Return whether a worker has started the job."""
        return (self.folder / str(number)).exists()

    def states(self, numbers: Iterable[int]) -> str:
        """Return the progress of these jobs in words; empty where none has begun."""
        begun = [count for count in map(self._count, numbers) if count[1]]
        if not begun:
            return ""
        done, total = (sum(column) for column in zip(*begun, strict=True))
        return f"state {done} of {total} in {len(begun)} under way"

    def _count(self, number: int) -> tuple[int, int]:
        try:
            done, total = (self.folder / str(number)).read_text().split()
            return int(done), int(total)
        except (OSError, ValueError):  # not begun, or being written
            return 0, 0


class JobProgress:
    """The worker's view: progress of one job as a file, which the driver reads; also its own bar.

    When the driver ends, the folder is removed, and a worker that the driver cannot stop ends after its next state.

    Args:
        file: of the job.
        say: called at every state if the driver is this process.
    """

    def __init__(self, file: Path, say: Callable[[str], None] | None = None) -> None:
        self._file, self._say = file, say
        self.notes: list[str] = []
        self._done = self._total = 0
        self._write()

    def begin(self, title: str, total: int, done: int = 0) -> JobProgress:
        self._done, self._total = done, total
        self._write()
        return self

    def advance(self, steps: int = 1) -> None:
        self._done += steps
        self._write()

    def describe(self, text: str) -> None:
        pass

    def expect(self, total: int) -> None:
        self._total = total
        self._write()

    def finish(self) -> None:
        pass

    def note(self, text: str) -> None:
        self.notes.append(text)

    def _write(self) -> None:
        self._file.write_text(f"{self._done} {self._total}")
        if self._say is not None and self._total:
            self._say(f"state {self._done} of {self._total}")


@contextmanager
def progress_store_in(store: Path) -> Iterator[ProgressStore]:
    """Yield a new folder in a store; raises `UserError` where the store cannot be written."""
    folder = store.resolve() / FOLDER / uuid.uuid4().hex[:16]
    try:
        folder.mkdir(parents=True)
        _remove_abandoned(folder)
        lock = FileLock(folder / LOCK)
        lock.acquire(timeout=0)
    except (OSError, NotImplementedError) as error:
        cause = getattr(error, "strerror", None) or error
        raise UserError(f"{store} cannot be written ({cause}); choose another store with --store.") from None
    try:
        yield ProgressStore(folder)
    finally:
        lock.release()
        shutil.rmtree(folder, ignore_errors=True)


def _remove_abandoned(own: Path) -> None:
    """Remove the folders of drivers that were killed."""
    for folder in own.parent.iterdir():
        lock = folder / LOCK
        if folder == own or not lock.exists():
            continue
        try:
            with FileLock(lock).acquire(timeout=0):
                shutil.rmtree(folder, ignore_errors=True)
        except (Timeout, OSError):
            continue
