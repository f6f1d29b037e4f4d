"""The shape of a network's doubt: what its states leave open, to first order in its parameters."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from pliant.records.design import Array
from pliant.records.error_bar import ErrorBar
from pliant_plugins.surrogates.neural.system import Scales, States, System
from pliant_plugins.surrogates.neural.training import Stop, library

# Shares of decay that parameters are believed to have had before the states were seen; the likeliest is taken.
BELIEFS = tuple(10.0**-e for e in range(2, 11))
# Misses grow less than the doubt does. Of 0.7, 0.8 and 1, bands of 28 bending designs hold 94, 91 and 84 % of states.
STEEPNESS = 0.7
# Points of the box at which the bar's shape is kept, as a power of 2, and how far each reaches, in their spacing.
PLACES, REACH = 8, 0.8
TINY = 1e-9  # of the range


def error_bar(
    states: States, scales: Scales, units: int, stop: Stop, misses: Array, part: NDArray[np.int64]
) -> ErrorBar:
    """The bar of a network from the misses (n, k) of those trained without the part (n,) that each state is in.

    Laplace's approximation: parameters have the covariance (JᵀJ + Λ)⁻¹ about the network, J of the states it saw
    (MacKay, Neural Comput. 4, 1992). The size s of what it leaves open foretells the miss of a state left out as
    c s^`STEEPNESS`; the misses themselves give c, and Λ makes them likeliest.
    """
    torch = library()
    k = states.tau.shape[1]
    system = System(torch, states, scales, units, np.ones((1, len(part)), bool))
    theta = torch.from_numpy(stop.parameters[0])
    jacobian, own = system.jacobian(theta[None])[0], system.values(theta, states.points)
    state = system.known // (2 * k + k * (k + 1) // 2)
    box = np.stack([scales.centre - scales.half, scales.centre + scales.half], axis=1)
    at = 2 * qmc.Sobol(1 + k, scramble=False).random_base2(PLACES) - 1
    places = system.values(theta, scales.centre + scales.half * at)
    shares = np.abs(misses) / scales.ranges
    best: tuple[float, Array, Array] | None = None
    for belief in BELIEFS:
        decay = belief / units * system.share
        foretold = np.empty_like(shares)
        for fold in range(part.max() + 1):
            seen = torch.from_numpy(np.flatnonzero(part[state] != fold))
            foretold[part == fold] = _sizes(torch, jacobian[seen], decay, own[part == fold])
        scores = np.maximum(shares, TINY) / np.maximum(foretold, TINY)
        size = np.sqrt(np.mean(scores**2, axis=0))
        likely = float(-np.sum(np.log(np.maximum(foretold, TINY) * size)))
        if best is None or likely > best[0]:
            best = likely, _sizes(torch, jacobian, decay, places), scores
    assert best is not None
    _, sizes, scores = best
    reach = REACH * 2 * len(at) ** (-1 / (1 + k))
    return ErrorBar.of_shape(box, at, sizes * scales.ranges, scores, reach)


def _sizes(torch: Any, jacobian: Any, decay: Any, values: Any) -> Array:
    """(n, k) foretold sizes, but for a factor, of misses where τ has the derivatives `values` (n, k, q)."""
    normal = jacobian.T @ jacobian
    normal.diagonal().add_(decay)
    factor = torch.linalg.cholesky(normal)
    flat = values.reshape(-1, values.shape[2])
    solved = torch.linalg.solve_triangular(factor, flat.T, upper=False)
    variances: Array = (solved * solved).sum(dim=0).reshape(values.shape[:2]).numpy()
    return np.asarray(variances ** (STEEPNESS / 2))
