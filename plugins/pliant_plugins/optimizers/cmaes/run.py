"""One run of pycma, from its first mean until it stops by itself."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence

import cma
import numpy as np

from pliant.records.design import Array
from pliant_plugins.optimizers.cmaes.encoding import Encoding
from pliant_plugins.optimizers.cmaes.own_random import OwnRandom


class Run:
    """pycma with bounds, whole numbers and a random stream of its own.

    Bounds are kept by pycma's `BoundTransform`: every sample maps to a point inside that is evaluated as it is. Its
    `BoundPenalty` would add penalties that it weighs by the objective's spread, which failed and refused candidates
    distort.
    """

    def __init__(
        self, encoding: Encoding, mean: Array | None, sigma: float, population: int, seed: Sequence[int]
    ) -> None:
        """`mean` None: uniformly drawn."""
        self._random = OwnRandom(seed)
        with self._random.lent():
            first = np.random.uniform(0.0, encoding.high) if mean is None else mean
            self._pycma = cma.CMAEvolutionStrategy(first, sigma, _options(encoding, population))

    def sample(self, count: int) -> list[Array]:
        """`count` arrays (n,) within bounds."""
        with self._random.lent():
            drawn: list[Array] = self._pycma.ask(count)
        return drawn

    def learn(self, samples: Sequence[Array], values: Sequence[float]) -> bool:
        """Update from a generation, low values being good; whether the run has come to its end.

        Samples that were drawn before the last update count as injected ones (Hansen 2011, Injecting external
        solutions into CMA-ES), whose step pycma limits.
        """
        with self._random.lent(), warnings.catch_warnings():
            warnings.filterwarnings("ignore", category=UserWarning, module="cma")  # about the injected ones
            self._pycma.tell(list(samples), list(values))
            return bool(self._pycma.stop())


def _options(encoding: Encoding, population: int) -> dict[str, object]:
    return {
        "bounds": [[0.0] * len(encoding.high), list(encoding.high)],
        "BoundaryHandler": "BoundTransform",
        "CMA_stds": list(encoding.high),
        "integer_variables": list(encoding.whole),
        "minstd": encoding.least_std if encoding.least_std.any() else 0,
        "popsize": population,
        "maxiter": math.inf,  # the search's budget ends it
        "maxfevals": math.inf,
        "seed": math.nan,  # leave numpy's generator alone
        "verbose": -9,
        "verb_disp": 0,
        "verb_log": 0,
        "signals_filename": "",
    }
