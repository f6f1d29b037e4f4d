"""Random numbers of our own in libraries that draw from global generators."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

# What a draw is for; each has a sequence of its own.
START, CANDIDATE, UPDATE = 0, 1, 2


@contextmanager
def drawn_from(torch: Any, seed: int, purpose: int, number: int) -> Iterator[None]:
    """torch and numpy draw from (seed, purpose, number), torch on one thread; after it all is as it was before."""
    word = int(np.random.SeedSequence((seed, purpose, number)).generate_state(1)[0])
    threads, numpy_state = torch.get_num_threads(), np.random.get_state()
    generator = torch.random.default_generator
    torch_state = generator.get_state()
    try:
        if threads != 1:
            torch.set_num_threads(1)  # sums over threads would depend on their number
        generator.manual_seed(word)
        np.random.seed(word)
        yield
    finally:
        np.random.set_state(numpy_state)
        generator.set_state(torch_state)
        if threads != 1:
            torch.set_num_threads(threads)
