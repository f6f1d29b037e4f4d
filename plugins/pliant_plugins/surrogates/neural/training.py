"""Training: Levenberg and Marquardt's steps, from a stiff network to ever more supple ones."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pliant.records.design import Array
from pliant_plugins.native import load_torch
from pliant_plugins.surrogates.neural.network import Network
from pliant_plugins.surrogates.neural.system import Scales, States, System

# Shares of decay that are tried, from smooth to supple; each starts where the one before it ended.
DECAYS = tuple(10.0**-e for e in range(3, 13))
STEPS = 6
# Damping of a step: at the start, when a step fails, when it succeeds, at least; tries for a step.
DAMPING, HARDER, EASIER, LEAST_DAMPING, TRIES = 1e-5, 8.0, 3.0, 1e-12, 14
# A step that gains less than this share ends a decay's steps.
STALLED = 1e-3


@dataclass(frozen=True, eq=False)
class Stop:
    """Networks at one decay, one for each row of the mask of states that are seen.

    Attributes:
        residuals: (g,) roots of the mean squares of the weighted residuals, as a share of the range.
        steps: (g,) taken so far.
        parameters: (g, q) θ of `System`.
    """

    decay: float
    networks: tuple[Network, ...]
    residuals: Array
    steps: Array
    parameters: Array


def library() -> Any:
    """torch; raises `MissingDependencyError` with the command that installs it."""
    return load_torch("surrogate 'neural' needs torch to fit a law, though not to load one")


def train(states: States, scales: Scales, units: int, seed: int, seen: NDArray[np.bool_]) -> Iterator[Stop]:
    """Networks of ever less decay, one for each row of `seen` (g, n), side by side.

    Deterministic: one thread, a generator of its own, no global state left changed.
    """
    torch = library()
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield from _train(torch, System(torch, states, scales, units, seen), seed)
    finally:
        torch.set_num_threads(threads)


def _train(torch: Any, system: System, seed: int) -> Iterator[Stop]:
    theta = system.start(seed)
    damping = torch.full((len(theta),), DAMPING, dtype=torch.float64)
    steps = torch.zeros(len(theta), dtype=torch.int64)
    for decay in DECAYS:
        weight = decay / system.units * system.share
        going = torch.arange(len(theta))
        for _ in range(STEPS):
            gained = _step(torch, system, theta, damping, weight, going)
            steps[going] += (gained > 0).to(torch.int64)
            going = going[gained >= STALLED]
            if len(going) == 0:
                break
        residuals = torch.linalg.vector_norm(system.residual(theta), dim=1)
        networks = tuple(system.network(one) for one in theta)
        yield Stop(decay, networks, residuals.numpy(), steps.numpy().copy(), theta.numpy().copy())


def _step(torch: Any, system: System, theta: Any, damping: Any, weight: Any, going: Any) -> Any:
    """Move θ and dampings of the networks `going` in place; (g,) the share of its loss that each of them gained."""
    jacobian, residual = system.jacobian(theta[going], going), system.residual(theta[going], going)
    normal = jacobian.mT @ jacobian
    normal.diagonal(dim1=1, dim2=2).add_(weight)
    downhill = (jacobian.mT @ residual[..., None])[..., 0] + weight * theta[going]
    loss = _loss(residual, theta[going], weight)
    gained = torch.zeros_like(loss)
    waiting = torch.arange(len(going))
    for _ in range(TRIES):
        at = going[waiting]
        damped = normal[waiting]
        damped.diagonal(dim1=1, dim2=2).add_(damping[at, None])
        factor, failed = torch.linalg.cholesky_ex(damped)
        tried = theta[at] - torch.cholesky_solve(downhill[waiting, :, None], factor)[..., 0]
        lower = _loss(system.residual(tried, at), tried, weight)
        better = (failed == 0) & (lower < loss[waiting])
        done = waiting[better]
        theta[going[done]] = tried[better]
        gained[done] = 1 - lower[better] / loss[done]
        damping[at] *= torch.where(better, 1 / EASIER, HARDER)
        waiting = waiting[~better]
        if len(waiting) == 0:
            break
    damping.clamp_(min=LEAST_DAMPING)
    return gained


def _loss(residual: Any, theta: Any, weight: Any) -> Any:
    """(g,)."""
    return (residual * residual).sum(dim=1) + (weight * theta * theta).sum(dim=1)
