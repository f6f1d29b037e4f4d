"""The states as equations of a network's parameters, and training by Levenberg and Marquardt's steps.

torch differentiates the equations, unit by unit; networks go from stiff to ever more supple ones."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pliant.records.design import Array
from pliant.records.law import Domain
from pliant_plugins.native import load_torch
from pliant_plugins.surrogates.neural.network import Network

# As for polynomials: slopes are steeper than values, with equal weight they would rule the fit.
SLOPE_WEIGHT = 0.2
# Decay of the quadratic form as a share of a unit's: it is the law without units.
PLAIN = 0.01


@dataclass(frozen=True, eq=False)
class States:
    """n states of m inputs and k axes: points (n, m + k), tau (n, k), gains (n, k, m), slopes (n, k, k).

    Unknown slopes are NaN; gains may be (n, k) of one input.
    """

    points: Array
    tau: Array
    gain: Array
    slope: Array


@dataclass(frozen=True, eq=False)
class Scales:
    """Centre and half-width of each coordinate, (m + k,), and the range of each effort, (k,)."""

    centre: Array
    half: Array
    ranges: Array

    @staticmethod
    def from_domain(domain: Domain, ranges: Array) -> Scales:
        """Return the scales of a box."""
        box = domain.box
        return Scales(box.mean(axis=1), np.ptp(box, axis=1) / 2, ranges)

    @property
    def energy(self) -> float:
        """J: the largest range times half-width."""
        return float(np.max(self.ranges * self.half[self.n_inputs :]))

    @property
    def n_inputs(self) -> int:
        """Number m of actuations."""
        return len(self.half) - len(self.ranges)


class ResidualSystem:
    """Residuals of the scaled states and their derivatives by the parameters θ (g, q) of g networks at once.

    Each network sees the states that its row of a mask (g, n) chooses. θ is, one after another, w (m + k), b, c of
    each unit; then effort, gains (those of all axes by the first input, …) and the upper triangle of the stiffness of
    the quadratic form.
    """

    def __init__(
        self, torch: Any, states: States, scales: Scales, units: int, seen: NDArray[np.bool_]
    ) -> None:
        self.torch, self.scales, self.units = torch, scales, units
        self.k, self.m = states.tau.shape[1], scales.n_inputs
        self.upper = np.triu_indices(self.k)
        self.width = self.m + self.k + 2
        half, tau_unit = scales.half, scales.energy / scales.half[self.m :]
        # second derivatives of Π in the data: by p_j and u_i, by u_i and u_j
        axes, inputs = np.tile(np.arange(self.k), self.m), np.repeat(np.arange(self.m), self.k)
        self.first = np.concatenate([inputs, self.m + self.upper[0]])
        self.second = np.concatenate([self.m + axes, self.m + self.upper[1]])
        to_unit = np.concatenate(
            [
                1 / tau_unit,
                half[inputs] / tau_unit[axes],
                half[self.m + self.upper[0]] / tau_unit[self.upper[1]],
            ]
        )
        shares = tau_unit / scales.ranges
        slope_shares = SLOPE_WEIGHT * np.concatenate(
            [shares[axes], np.sqrt(shares[self.upper[0]] * shares[self.upper[1]])]
        )
        n = len(states.tau)
        gain = np.swapaxes(states.gain.reshape(n, self.k, self.m), 1, 2).reshape(n, -1)
        wanted = np.concatenate([states.tau, gain, states.slope[:, *self.upper]], axis=1) * to_unit
        self.rows = wanted.shape[1]  # of a state
        known = np.isfinite(wanted)
        of_state = seen / np.sqrt(seen.sum(axis=1, keepdims=True))
        weights = of_state[:, :, None] * np.concatenate([shares, slope_shares])
        as_tensor = torch.from_numpy
        self.x = as_tensor((states.points - scales.centre) / half)
        self.known = np.flatnonzero(known)
        self.wanted = as_tensor(wanted[known])
        self.weights = as_tensor(weights.reshape(len(seen), -1)[:, self.known])
        self.plain = as_tensor(self._plain(self.x.numpy()).reshape(known.size, -1)[self.known])
        share = np.ones(units * self.width + self.plain.shape[1])
        share[units * self.width :] = PLAIN
        self.share = as_tensor(share)

    def start(self, seed: int) -> Any:
        """Return (g, q) the same random units, with the factors and the form of each network that fit best."""
        torch, m = self.torch, self.units * self.width
        random = torch.Generator().manual_seed(seed)
        of_units = torch.zeros(self.units, self.width, dtype=torch.float64)
        d = self.m + self.k
        of_units[:, :d] = torch.randn(self.units, d, generator=random, dtype=torch.float64)
        of_units[:, d] = 3 * torch.rand(self.units, generator=random, dtype=torch.float64) - 1.5
        theta = torch.cat([of_units.ravel(), torch.zeros(len(self.share) - m, dtype=torch.float64)])
        theta = theta.repeat(len(self.weights), 1)
        linear = torch.cat([torch.arange(self.units) * self.width + d + 1, torch.arange(m, theta.shape[1])])
        matrix = self.jacobian(theta)[:, :, linear]
        normal = matrix.mT @ matrix
        normal.diagonal(dim1=1, dim2=2).add_(1e-4 / self.units)
        theta[:, linear] = -torch.linalg.solve(normal, matrix.mT @ self.residual(theta)[..., None])[..., 0]
        return theta

    def values(self, theta: Any, points: Array) -> Any:
        """Return (n, k, q) derivatives of τ, as shares of its range, at points (n, m + k), by one network's θ (q,)."""
        torch, k = self.torch, self.k
        x = torch.from_numpy((points - self.scales.centre) / self.scales.half)
        of_units = self._unit_derivatives(theta[None], x)[0]
        plain = torch.from_numpy(self._plain(x.numpy())).reshape(len(of_units), -1)
        both = torch.cat([of_units, plain], dim=1).reshape(len(x), -1, len(self.share))[:, :k]
        shares = self.scales.energy / (self.scales.half[self.m :] * self.scales.ranges)
        return both * torch.from_numpy(shares)[:, None]

    def residual(self, theta: Any, which: Any = slice(None)) -> Any:
        """Return (g, m) residuals of the data as shares of the effort's range; 0 for states that a network omits.

        `which` are the networks that θ (g, q) is of.
        """
        of_units = self.torch.func.vmap(lambda one: self._unit(one, self.x).ravel())(self._units(theta))
        of_units = of_units.reshape(len(theta), self.units, -1).sum(dim=1)[:, self.known]
        plain = theta[:, self.units * self.width :] @ self.plain.T
        return (of_units + plain - self.wanted) * self.weights[which]

    def jacobian(self, theta: Any, which: Any = slice(None)) -> Any:
        """Return (g, m, q) derivatives of `residual`: each unit by its own parameters only."""
        of_units = self._unit_derivatives(theta, self.x)[:, self.known]
        plain = self.plain.expand(len(theta), -1, -1)
        return self.torch.cat([of_units, plain], dim=2) * self.weights[which][..., None]

    def network(self, theta: Any) -> Network:
        """Return the network of one θ (q,) in SI."""
        numbers, k, m, scales = theta.numpy(), self.k, self.m, self.scales
        end = self.units * self.width
        of_units = numbers[:end].reshape(self.units, self.width)
        effort, gain, upper = np.split(numbers[end:], [k, (1 + m) * k])
        stiffness = np.zeros((k, k))
        stiffness[self.upper] = upper
        stiffness = np.triu(stiffness) + np.triu(stiffness, 1).T
        half = scales.half[m:]
        stiffness = scales.energy * stiffness / np.outer(half, half)
        weights = of_units[:, : m + k] / scales.half
        gains = scales.energy * gain.reshape(m, k).T / np.outer(half, scales.half[:m])
        effort = scales.energy * effort / half - gains @ scales.centre[:m] + stiffness @ scales.centre[m:]
        offsets = of_units[:, m + k] - weights @ scales.centre
        factors = scales.energy * of_units[:, m + k + 1]
        return Network(weights, offsets, factors, effort, gains[:, 0] if m == 1 else gains, stiffness)

    def _units(self, theta: Any) -> Any:
        """Return units (g · units, width)."""
        return theta[:, : self.units * self.width].reshape(-1, self.width)

    def _unit_derivatives(self, theta: Any, x: Any) -> Any:
        """Return (g, n · r, units · width) derivatives of `_unit`."""
        func = self.torch.func
        found = func.vmap(func.jacfwd(lambda one: self._unit(one, x).ravel()))(self._units(theta))
        found = found.reshape(len(theta), self.units, -1, self.width).transpose(1, 2)
        return found.reshape(len(theta), found.shape[1], -1)

    def _unit(self, theta: Any, x: Any) -> Any:
        """Return (n, r) contributions of one unit to τ, to ∂τ/∂p and to the upper triangle of ∂τ/∂u."""
        torch, d = self.torch, self.m + self.k
        w = theta[:d]
        z = x @ w + theta[d]
        bell = torch.rsqrt(1 + z * z)
        slopes = (z * bell)[:, None] * w[self.m :]
        curvatures = (bell**3)[:, None] * (w[self.first] * w[self.second])
        return -theta[d + 1] * torch.cat([slopes, curvatures], dim=1)

    def _plain(self, x: Array) -> Array:
        """Return (n, r, q) contributions of the quadratic form to the same, by its q parameters."""
        k, m = self.k, self.m
        rows = np.zeros((len(x), self.rows, self.rows))
        axes, of_upper = np.arange(k), (1 + m) * k
        rows[:, axes, axes] = 1.0
        for of_input in range(m):
            place = (1 + of_input) * k + axes
            rows[:, axes, place] = x[:, of_input : of_input + 1]
            rows[:, place, place] = 1.0
        for at, (i, j) in enumerate(zip(*self.upper, strict=True)):
            rows[:, i, of_upper + at] -= x[:, m + j]
            if i != j:
                rows[:, j, of_upper + at] -= x[:, m + i]
            rows[:, of_upper + at, of_upper + at] = -1.0
        return rows


# Shares of decay that are tried, from smooth to supple; each starts where the one before it ended.
DECAYS = tuple(10.0**-e for e in range(3, 13))
STEPS = 6
# Damping of a step: at the start, when a step fails, when it succeeds, at least; tries for a step.
DAMPING, HARDER, EASIER, LEAST_DAMPING, TRIES = 1e-5, 8.0, 3.0, 1e-12, 14
# A step that gains less than this share ends a decay's steps.
STALLED = 1e-3


@dataclass(frozen=True, eq=False)
class EarlyStopping:
    """Networks at one decay, one for each row of the mask of states that are seen.

    Attributes:
        residuals: (g,) roots of the mean squares of the weighted residuals, as a share of the range.
        steps: (g,) taken so far.
        parameters: (g, q) θ of `ResidualSystem`.
    """

    decay: float
    networks: tuple[Network, ...]
    residuals: Array
    steps: Array
    parameters: Array


def library() -> Any:
    """Import torch; raise `MissingDependencyError` with the command that installs it."""
    return load_torch("surrogate 'neural' needs torch to fit a law, though not to load one")


def train(
    states: States, scales: Scales, units: int, seed: int, seen: NDArray[np.bool_]
) -> Iterator[EarlyStopping]:
    """Train networks with decreasing weight decay, one for each row of `seen` (g, n), in parallel.

    Deterministic: one thread, a separate generator, no change of global state.
    """
    torch = library()
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield from _train(torch, ResidualSystem(torch, states, scales, units, seen), seed)
    finally:
        torch.set_num_threads(threads)


def _train(torch: Any, system: ResidualSystem, seed: int) -> Iterator[EarlyStopping]:
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
        yield EarlyStopping(decay, networks, residuals.numpy(), steps.numpy().copy(), theta.numpy().copy())


def _step(torch: Any, system: ResidualSystem, theta: Any, damping: Any, weight: Any, going: Any) -> Any:
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
    """Return (g,) loss of every group."""
    return (residual * residual).sum(dim=1) + (weight * theta * theta).sum(dim=1)
