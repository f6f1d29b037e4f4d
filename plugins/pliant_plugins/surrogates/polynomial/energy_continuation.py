"""How the law of a polynomial energy goes on outside its box: reaches, bowls and reference gains."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from pliant.records.design import Array
from pliant_plugins.surrogates.polynomial import energy_kernel
from pliant_plugins.surrogates.polynomial.energy import EnergyBasis
from pliant_plugins.surrogates.polynomial.energy_scalar import UNBOUNDED, pack

# A continuation leaves at least this share of the border's stiffness.
STIFFNESS_SHARE = 0.5
# Coupling terms see the deformation up to this share of the box's half-width outside it: the first that bowls can
# make stable, since a bowl helps no axis that is inside.
REACHES = (0.2, 0.1, 0.05, 0.025)
# Bowls that are tried, as shares of the typical stiffness of their axis in the box: doubled, then halved between.
FIRST, DOUBLINGS, HALVINGS = 1 / 16, 11, 4
# Places outside the box, in reaches beyond it, where the continuation is looked at: where coupling terms bend
# most, and where they are as good as constant and bowls at five sixths of their stiffness; beyond, bowls only grow.
BEYOND = (0.6, 5.0)
# Where the reaches in p are read off.
BESIDE = (0.6,)
# Places of ∂τ_i/∂u_j among the kernel's six slopes.
UPPER = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])


@dataclass(frozen=True, eq=False)
class Continuation:
    """Reaches in p (2,) and u (k,), bowls (k,) in N·m/rad and gains at the reference point (2, k)."""

    reach_p: Array
    reach_u: Array
    bowls: Array
    gains: Array


def packed(basis: EnergyBasis, coefficients: Array, box: Array, how: Continuation) -> Array:
    """The parameters of `energy_scalar.energy_effort`; box (1 + k, 2)."""
    maps = (basis.actuation_map, basis.deformation_map)
    reaches = (how.reach_p, how.reach_u)
    return pack(basis.exponents, coefficients, maps, box, reaches, how.bowls, how.gains)


def continuation(basis: EnergyBasis, coefficients: Array, box: Array) -> Continuation:
    """The smallest bowls, and then the reaches in p, with which half of the border's stiffness remains outside.

    Where the law is unstable on its border there is nothing to protect: bowls are those of a stable law's size.
    """
    k = len(box) - 1
    bounded = np.all(np.isfinite(box[1:]), axis=1, keepdims=True)
    half = np.ptp(np.where(bounded, box[1:], [-1.0, 1.0]), axis=1) / 2
    tried = Continuation(np.full(2, np.inf), REACHES[0] * half, np.zeros(k), np.zeros((2, k)))
    at_p = [p for p in np.clip(box[0], -UNBOUNDED, UNBOUNDED) if abs(p) < UNBOUNDED]
    if k > 1 and at_p:
        tried = _with_bowls(basis, coefficients, box, half, at_p, tried)
    parameters = packed(basis, coefficients, box, tried)
    places = _places(box, tried.reach_u, BESIDE)
    sides = [_side(parameters, box, places, index) for index in (0, 1)]
    reach = np.array([limit for limit, _ in sides])
    return Continuation(reach, tried.reach_u, tried.bowls, np.array([gain for _, gain in sides]))


def stiffness(parameters: Array, actuation: list[float], places: Array) -> Array:
    """(n, k, k) −∂τ/∂u at all places (m, k) under each of the actuations."""
    k = places.shape[1]
    p = np.repeat(actuation, len(places))
    found = energy_kernel.evaluate(p, np.tile(places, (len(actuation), 1)), parameters)
    matrix: Array = -found[:, 7:][:, UPPER[:k, :k]]
    return matrix


def _with_bowls(
    basis: EnergyBasis, coefficients: Array, box: Array, half: Array, at_p: list[float], plain: Continuation
) -> Continuation:
    """The continuation with bowls, all in proportion to the typical stiffness of their axis."""
    k = len(half)
    inner = stiffness(packed(basis, coefficients, box, plain), at_p, _places(box, half, ()))
    typical = np.median(np.abs(np.diagonal(inner, axis1=1, axis2=2)), axis=0)
    typical = np.maximum(typical, np.finfo(float).tiny)
    needed = STIFFNESS_SHARE * max(float(np.linalg.eigvalsh(inner).min()), 0.0)
    if needed <= 0:
        return replace(plain, bowls=typical)
    for share in REACHES:
        tried = replace(plain, reach_u=share * half)
        outer = _places(box, tried.reach_u, BEYOND)
        bare = stiffness(packed(basis, coefficients, box, tried), at_p, outer) - needed * np.eye(k)
        excess = np.maximum(np.maximum(box[1:, 0] - outer, outer - box[1:, 1]), 0.0) / tried.reach_u
        size = _smallest(bare, np.tile(typical * excess / (1 + excess), (len(at_p), 1)))
        if size is not None:
            return replace(tried, bowls=size * typical)
    return replace(tried, bowls=typical)


def _smallest(matrices: Array, diagonals: Array) -> float | None:
    """The smallest factor, within a few per cent, that makes matrices + factor · diagonals positive definite."""
    if _definite(matrices, 0.0 * diagonals):
        return 0.0
    sizes = FIRST * 2.0 ** np.arange(DOUBLINGS)
    if not _definite(matrices, sizes[-1] * diagonals):
        return None
    high = float(next(size for size in sizes if _definite(matrices, size * diagonals)))
    low = 0.0 if high == FIRST else high / 2
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        low, high = (low, middle) if _definite(matrices, middle * diagonals) else (middle, high)
    return high


def _definite(matrices: Array, diagonals: Array) -> bool:
    """Whether all symmetric matrices (n, k, k) with diagonals (n, k) added are positive definite."""
    return bool(np.all(_each_definite(matrices, diagonals)))


def _each_definite(matrices: Array, diagonals: Array) -> NDArray[np.bool_]:
    """(n,) which of symmetric matrices (n, k, k), k ≤ 3, with diagonals (n, k) added are; by leading minors."""
    d = [matrices[:, i, i] + diagonals[:, i] for i in range(diagonals.shape[1])]
    found: NDArray[np.bool_] = d[0] > 0
    if len(d) > 1:
        b = matrices[:, 0, 1]
        second = d[0] * d[1] - b**2
        found &= second > 0
    if len(d) > 2:
        c, e = matrices[:, 0, 2], matrices[:, 1, 2]
        found &= d[2] * second > d[0] * e**2 - 2 * b * c * e + d[1] * c**2
    return found


def _places(box: Array, steps: Array, beyond: tuple[float, ...]) -> Array:
    """(m, k) a grid over the box in u, and so many steps (k,) outside it."""
    low, high = np.clip(box[1:], -np.pi, np.pi).T[:, :, None]
    outside = np.asarray(steps)[:, None] * np.array(beyond)
    inside = np.linspace(low[:, 0], high[:, 0], 3 if len(box) > 2 else 65, axis=1)
    levels = np.concatenate([inside, low - outside, high + outside], axis=1)
    return levels[np.arange(len(levels)), _grid(levels.shape[1], len(levels))]


@cache
def _grid(levels: int, axes: int) -> NDArray[np.int64]:
    """(levels^axes, axes) every combination of levels, the last axis fastest."""
    return np.indices((levels,) * axes).reshape(axes, -1).T


def _side(parameters: Array, box: Array, places: Array, index: int) -> tuple[float, Array]:
    """L and the gain at the reference point on the lower (0) or upper (1) side of the box in p."""
    k = places.shape[1]
    border = float(box[0, index])
    if not np.isfinite(border):
        return np.inf, np.zeros(k)
    nearest = np.clip(np.zeros(k), box[1:, 0], box[1:, 1])[None]
    gain = energy_kernel.evaluate(np.array([border]), nearest, parameters)[0, 4 : 4 + k]
    step = float(np.ptp(box[0])) * (1 if index else -1)
    K = stiffness(parameters, [border], places)
    softening = K - stiffness(parameters, [border + step], places)  # per step: linear in p there
    stable = _each_definite(K, np.zeros(places.shape))
    if not stable.any():
        return 1e-3 * abs(step), gain
    # the largest λ with softening v = λ K v
    L = np.linalg.inv(np.linalg.cholesky(K[stable]))
    worst = float(np.linalg.eigvalsh(L @ softening[stable] @ np.swapaxes(L, 1, 2)).max())
    return (STIFFNESS_SHARE * abs(step) / worst if worst > 0 else np.inf), gain
