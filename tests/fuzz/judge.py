"""Judge one damaged input and reader: within its time and memory it answers or raises one of Pliant's errors."""

from __future__ import annotations

import faulthandler
import gc
import resource
import signal
import tempfile
import time
import traceback
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.fuzz.targets import OWN_ERRORS, Target

LONGEST_S = 2.0  # of CPU
MOST_BYTES = 500_000_000  # above the memory in use
LONGEST_MESSAGE = 20_000


class TooSlow(BaseException):
    """A timeout, not derived from Exception so that no `except Exception` of a reader catches it."""


def _too_slow(*_: object) -> None:
    raise TooSlow


@contextmanager
def limited() -> Iterator[None]:
    """Limit the address space of this process inside the block."""
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    now = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (now + MOST_BYTES, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


def verdict(target: Target, data: bytes) -> str:
    """Return what a reader does wrong with this input, or an empty text."""
    with tempfile.TemporaryDirectory(prefix="fuzz-") as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        before = signal.signal(signal.SIGVTALRM, _too_slow)
        began = time.process_time()
        signal.setitimer(signal.ITIMER_VIRTUAL, LONGEST_S)
        try:
            with limited():
                target.feed(data, Path(folder))
        except OWN_ERRORS as error:
            return "" if len(str(error)) < LONGEST_MESSAGE else f"a message of {len(str(error))} characters"
        except TooSlow as error:
            return f"more than {LONGEST_S} s in {_where(error)}"
        except MemoryError as error:
            return f"more than {MOST_BYTES / 1e6:.0f} MB in {_where(error)}"
        except Exception as error:  # the defect
            return f"{type(error).__name__}: {str(error)[:200]} in {_where(error)}"
        finally:
            signal.setitimer(signal.ITIMER_VIRTUAL, 0)
            signal.signal(signal.SIGVTALRM, before)
            if time.process_time() - began > 1.0:
                gc.collect()
    return ""


def _where(error: BaseException) -> str:
    """Return the last place in Pliant's code that the error passed through."""
    frames = traceback.extract_tb(error.__traceback__)
    ours = [frame for frame in frames if "/pliant" in frame.filename]
    last = (ours or frames)[-1]
    return f"{Path(last.filename).name}:{last.lineno}"


faulthandler.enable()
