"""How far jobs are, wherever they run: a folder in the artifact store with a small file for each job.

That a worker finds the folder shows that it sees the same store. It goes when the work ends; one that a killed driver
left is known by its lock, which the operating system released, and goes with the next.
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
        """Forget how far a job was."""
        (self.folder / str(number)).unlink(missing_ok=True)

    def began(self, number: int) -> bool:
        """Whether a worker has taken the job up."""
        return (self.folder / str(number)).exists()

    def states(self, numbers: Iterable[int]) -> str:
        """How far these jobs are, in words; empty where none has begun."""
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
    """The worker's side: progress of one job as its file, which the driver reads; also its own bar.

    When the driver ends, the folder goes, and the next state of a worker that is beyond its reach is the last.

    Args:
        file: of the job.
        say: hears of every state where the driver is this process.
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
    """A new folder in a store; raises `UserError` where the store cannot be written."""
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
