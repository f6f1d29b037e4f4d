"""A sweep's desk: a folder in the store where workers show how far their designs are.

That a worker finds it shows that it sees the same store. It goes when the sweep ends; one that a killed sweep
left is known by its lock, which the operating system released, and goes with the next sweep.
"""

from __future__ import annotations

import shutil
import uuid
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from filelock import FileLock, Timeout

from pliant.errors import UserError

FOLDER = "sweeps"
LOCK = "lock"


class SweepDesk:
    """The driver's view of the folder: a file `done total` for each design that has begun."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def clear(self, number: int) -> None:
        """Forget how far a design was."""
        (self.folder / str(number)).unlink(missing_ok=True)

    def began(self, number: int) -> bool:
        """Whether a worker has taken the design up."""
        return (self.folder / str(number)).exists()

    def states(self, numbers: Iterable[int]) -> str:
        """How far these designs are, in words; empty where none has begun."""
        wanted = {str(number) for number in numbers}
        files = [file for file in self.folder.iterdir() if file.name in wanted]
        begun = [count for count in map(self._count, files) if count[1]]
        if not begun:
            return ""
        done, total = (sum(column) for column in zip(*begun, strict=True))
        return f"state {done} of {total} in {len(begun)} under way"

    def _count(self, file: Path) -> tuple[int, int]:
        try:
            done, total = file.read_text().split()
            return int(done), int(total)
        except (OSError, ValueError):  # not begun, or being written
            return 0, 0


@contextmanager
def desk_in(store: Path) -> Iterator[SweepDesk]:
    """A new desk in a store; raises `UserError` where the store cannot be written."""
    folder = store.resolve() / FOLDER / uuid.uuid4().hex[:16]
    try:
        folder.mkdir(parents=True)
        _sweep_up(folder)
        lock = FileLock(folder / LOCK)
        lock.acquire(timeout=0)
    except (OSError, NotImplementedError) as error:
        cause = getattr(error, "strerror", None) or error
        raise UserError(f"{store} cannot be written ({cause}); choose another store with --store.") from None
    try:
        yield SweepDesk(folder)
    finally:
        lock.release()
        shutil.rmtree(folder, ignore_errors=True)


def _sweep_up(own: Path) -> None:
    """Remove the desks of sweeps that were killed."""
    for folder in own.parent.iterdir():
        lock = folder / LOCK
        if folder == own or not lock.exists():
            continue
        try:
            with FileLock(lock).acquire(timeout=0):
                shutil.rmtree(folder, ignore_errors=True)
        except (Timeout, OSError):
            continue
