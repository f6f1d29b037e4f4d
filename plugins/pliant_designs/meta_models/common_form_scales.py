"""Scales of a family's designs: parameters on [−1, 1], and smooth sizes of torques and angles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pliant.records.design import Array
from pliant.records.fem import TRUSTED, ModuleData
from pliant_designs.records import SolvedDesigns

# A parameter whose range spans this ratio or more counts by its logarithm.
LOG_RATIO = 1.02
RIDGE = 1e-6
# The Gaussians must halve the error on designs left out: scales that wiggle make every coefficient wiggle.
RESIDUAL_GAIN = 0.25
RESIDUAL_WIDTHS = (0.7, 1.2)
RESIDUAL_RIDGES = (1e-6, 1e-3, 1e-1)
# Designs per coefficient from which the power laws get products of two parameters.
DESIGNS_PER_TERM = 2.2
FLOOR = 1e-12


@dataclass(frozen=True, eq=False)
class ParameterMap:
    """s = (2 g(value) − a − b)/(b − a) with g the logarithm of positive parameters: the box becomes [−1, 1].

    Attributes:
        low, high: (d,) of the box, in the parameters' own units.
        logarithmic: (d,) which ones count by their logarithm.
    """

    low: Array
    high: Array
    logarithmic: NDArray[np.bool_]

    @staticmethod
    def from_designs(values: Array, logarithms: bool = True) -> ParameterMap:
        """Return the map of the box of designs (n, d)."""
        low, high = values.min(axis=0), values.max(axis=0)
        positive = low > 0
        wide = positive & (high > LOG_RATIO * np.where(positive, low, 1.0))
        return ParameterMap(low, high, wide if logarithms else np.zeros(len(low), bool))

    def __call__(self, values: Array) -> Array:
        """Return scaled parameters (m, d) of designs (m, d); the scale is extrapolated outside the box."""
        low, high, given = self._taken(self.low), self._taken(self.high), self._taken(values)
        width = np.where(high > low, high - low, 1.0)
        return (2 * given - low - high) / width

    def _taken(self, values: Array) -> Array:
        safe = np.where(self.logarithmic, np.maximum(values, FLOOR), 1.0)
        return np.where(self.logarithmic, np.log(safe), values)


@dataclass(frozen=True, eq=False)
class Trends:
    """Several quantities over scaled parameters: a polynomial of degree ≤ 2, and Gaussians about the solved designs.

    Quantity r is h(s) · b_r + Σ_i w_ir exp(−|s − s_i|² / (2 ℓ_r²)); the second part is what the first leaves, as far
    as it helps on designs left out one by one.

    Attributes:
        degree: of h.
        coefficients: (t, r) b; weights: (n, r) w; widths: (r,) ℓ; places: (n, d) s_i.
    """

    degree: int
    coefficients: Array
    weights: Array
    widths: Array
    places: Array

    @staticmethod
    def fit(places: Array, quantities: Array, least_gain: float = RESIDUAL_GAIN) -> Trends:
        """Fit quantities (n, r) at scaled parameters (n, d) by least squares with a small ridge.

        The Gaussians must bring the squared error on designs left out down to the share `least_gain`.
        """
        degree = degree_for(*places.shape)
        h = monomials(places, degree)
        penalty = RIDGE * len(h) * np.eye(h.shape[1])
        penalty[0, 0] = 0.0
        trend = np.asarray(np.linalg.solve(h.T @ h + penalty, h.T @ quantities), float)
        left = [_residual(places, column, least_gain) for column in (quantities - h @ trend).T]
        weights = np.stack([one[1] for one in left], axis=1)
        return Trends(degree, trend, weights, np.array([one[0] for one in left]), places)

    def __call__(self, places: Array) -> Array:
        """Return (m, r) quantities at scaled parameters (m, d)."""
        found: Array = monomials(places, self.degree) @ self.coefficients
        if not self.weights.any():
            return found
        apart = np.sum((places[:, None] - self.places[None]) ** 2, axis=2)
        near = np.exp(-apart[:, :, None] / (2 * self.widths**2))
        return found + np.einsum("mnr,nr->mr", near, self.weights)


def _residual(places: Array, column: Array, least_gain: float) -> tuple[float, Array]:
    """Return width and weights (n,) of the Gaussians with the least leave-one-out error; no weights if none helps."""
    apart = np.sum((places[:, None] - places[None]) ** 2, axis=2)
    best = (least_gain * float(np.sum(column**2)), 1.0, np.zeros(len(column)))
    for width in RESIDUAL_WIDTHS:
        kernel = np.exp(-apart / (2 * width**2))
        for ridge in RESIDUAL_RIDGES:
            inverse = np.linalg.inv(kernel + ridge * np.eye(len(kernel)))
            weights = inverse @ column
            missed = float(np.sum((weights / np.diagonal(inverse)) ** 2))
            if missed < best[0]:
                best = (missed, width, weights)
    return best[1], best[2]


def degree_for(designs: int, parameters: int) -> int:
    """Return 2 if there are enough designs for squares and products, else 1."""
    terms = (parameters + 1) * (parameters + 2) // 2
    return 2 if designs >= DESIGNS_PER_TERM * terms else 1


def monomials(places: Array, degree: int) -> Array:
    """Return (n, t) 1, s_i and for degree 2 s_i s_j of scaled parameters (n, d)."""
    n, d = places.shape
    columns = [np.ones(n), *places.T]
    if degree > 1:
        columns += [places[:, i] * places[:, j] for i in range(d) for j in range(i, d)]
    return np.stack(columns, axis=1)


def design_sizes(designs: SolvedDesigns) -> Array:
    """Return (n, k + 1) deflection ranges of each design's axes, and its energy: median effort times main range.

    Side axes count as far as they were turned in any state, trusted or not: their range is the study's choice.

    Under one actuation the main axis counts by its free angle at the highest where that state is trusted; one that
    is not is left to the states that are. So the sizes are rough, which matters little: they are scales.
    """
    return np.array([_sizes(data) for data in designs.data])


def fitted(data: ModuleData) -> NDArray[np.bool_]:
    """Return (n,) mask of the states for a meta-model: trusted ones of role "fit"."""
    return np.isin(data.status, TRUSTED) & (data.role == "fit")


def turned(data: ModuleData) -> tuple[Array, Array]:
    """Return (k,) lowest and (k,) highest deformation of fitted states; of side axes untrusted ones count too."""
    seen = data.role == "fit"
    good = fitted(data)
    low, high = (np.asarray(end(data.deformation[seen], axis=0), float) for end in (np.min, np.max))
    main = data.axes.index(data.main_axis)
    low[main], high[main] = np.min(data.deformation[good, main]), np.max(data.deformation[good, main])
    return low, high


def _sizes(data: ModuleData) -> list[float]:
    good = fitted(data)
    main = data.axes.index(data.main_axis)
    low, high = turned(data)
    reach = np.maximum(np.maximum(-low, high), FLOOR)
    if len(data.actuations) == 1:
        highest = data.actuation[data.role == "fit"].max(initial=0.0)
        full = good & (data.branch == "free") & (data.actuation >= 0.999 * highest)
        if full.any():
            reach[main] = np.abs(data.deformation[full, main]).max()
    efforts = np.abs(data.tau[good, main])
    # The median off the free branch: a stop, where efforts are many times larger, has no influence.
    loaded = efforts > 1e-6 * efforts.max(initial=0.0)
    effort = float(np.median(efforts[loaded])) if loaded.any() else FLOOR
    return [*np.maximum(reach, FLOOR), max(effort * reach[main], FLOOR)]
