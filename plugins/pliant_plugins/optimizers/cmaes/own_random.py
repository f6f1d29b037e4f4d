"""numpy's global generator lent to a library that knows no other, and given back untouched."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np


class OwnRandom:
    """A stream of random numbers of its own.

    pycma's integer handling calls `np.random.rand` whatever its option `randn` says, so the global state is
    exchanged for this one's during a call. Not for several threads at once.
    """

    def __init__(self, seed: Sequence[int]) -> None:
        self._state = np.random.RandomState(np.random.SeedSequence(seed).generate_state(8)).get_state()

    @contextmanager
    def lent(self) -> Iterator[None]:
        """np.random draws from this stream inside."""
        others = np.random.get_state()
        np.random.set_state(self._state)
        try:
            yield
        finally:
            self._state = np.random.get_state()
            np.random.set_state(others)
