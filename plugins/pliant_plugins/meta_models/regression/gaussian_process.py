"""Gaussian processes from scaled parameters to targets: mean, deviation and expected gain, in closed form."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pliant.records.design import Array

# Bounds of the kernel's widths on the box [−1, 1] (narrower ones chase noise), of noise and of the plane's size.
WIDTHS = (1.0, 30.0)
NOISE = (1e-7, 0.5)
TREND = (1e-3, 1e3)
SEED = 0
LARGEST = 1e-10
# Noise below this share of the other sizes drowns posterior variances in rounding.
JITTER = 1e-7


@dataclass(frozen=True, eq=False)
class GaussianProcesses:
    """One process for each of q targets z, of n places s (n, d), with the kernel

        k(s, s') = a κ(r) + b (1 + s·s') + c δ,   r² = Σ_i (s_i − s'_i)² / ℓ_i²,

    κ = exp(−r²/2), or Matérn's (1 + √5 r + 5 r²/3) exp(−√5 r) where that explains the targets better. The second
    term is a plane of unknown slope; c is what the states left undetermined (Rasmussen and Williams, Gaussian
    Processes for Machine Learning, 2006, ch. 2, 4, 5).

    Attributes:
        places: (n, d); targets: (n, q).
        centre, scale: (q,) mean and deviation by which targets are standardised.
        widths: (q, d) ℓ; sizes: (q, 3) a, b, c; rough: (q,) whether κ is Matérn's.
    """

    places: Array
    targets: Array
    centre: Array
    scale: Array
    widths: Array
    sizes: Array
    rough: NDArray[np.bool_]
    _inverse: Array = field(init=False, repr=False)
    _dual: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        n = len(self.places)
        kernel = self.kernel(self.places, self.places) + self.sizes[:, 2, None, None] * np.eye(n)
        inverse = np.linalg.inv(kernel)
        object.__setattr__(self, "_inverse", (inverse + np.swapaxes(inverse, 1, 2)) / 2)
        standard = (self.targets - self.centre) / self.scale
        object.__setattr__(self, "_dual", np.einsum("tij,jt->ti", self._inverse, standard))

    @staticmethod
    def fit(places: Array, targets: Array) -> GaussianProcesses:
        """Widths and sizes by the largest marginal likelihood, from one fixed start (scikit-learn)."""
        centre, scale = targets.mean(axis=0), targets.std(axis=0)
        scale = np.where(scale > 0, scale, 1.0)
        found = [_likeliest(places, column) for column in ((targets - centre) / scale).T]
        widths, sizes, rough = (np.array(part) for part in zip(*found, strict=True))
        return GaussianProcesses(places, targets, centre, scale, widths, sizes, rough.astype(bool))

    def kernel(self, one: Array, two: Array) -> Array:
        """(q, m, l) covariance of the standardised targets at places (m, d) and (l, d), without noise."""
        apart = (one[:, None] - two[None]) ** 2
        square = np.einsum("mld,td->tml", apart, self.widths**-2.0)
        found = np.exp(-square / 2)
        if self.rough.any():
            r = np.sqrt(5 * square[self.rough])
            found[self.rough] = (1 + r + r**2 / 3) * np.exp(-r)
        a, b = self.sizes[:, 0, None, None], self.sizes[:, 1, None, None]
        total: Array = a * found + b * (1 + one @ two.T)
        return total

    def mean(self, places: Array) -> Array:
        """(m, q) predicted targets at places (m, d)."""
        standard = np.einsum("tmi,ti->mt", self.kernel(places, self.places), self._dual)
        found: Array = self.centre + self.scale * standard
        return found

    def variance(self, places: Array) -> Array:
        """(m, q) variance of the targets at places (m, d), noise included, in the targets' units."""
        across = self.kernel(places, self.places)
        explained = np.einsum("tmi,tmi->mt", across @ self._inverse, across)
        prior = np.stack([np.diagonal(k) for k in self.kernel(places, places)], axis=1)
        left: Array = self.scale**2 * (np.maximum(prior - explained, 0.0) + self.sizes[:, 2])
        return left

    def left_out(self) -> Array:
        """(n, q) what the other designs predict for each minus its targets (Rasmussen and Williams, eq. 5.12)."""
        own = np.diagonal(self._inverse, axis1=1, axis2=2)
        missed: Array = -(self._dual / own).T * self.scale
        return missed

    def gain(self, candidates: Array, over: Array) -> Array:
        """(m,) share of the squared error over places (k, d), all targets together, that each candidate would remove.

        A target's variance at o falls by cov(o, c)² / (var(c) + noise), both given the solved designs (Cohn, Neural
        Networks 9, 1996; Sacks et al., Statistical Science 4, 1989); widths and sizes stay as they are.
        """
        to_c, to_o = self.kernel(candidates, self.places), self.kernel(over, self.places)
        solved = to_c @ self._inverse
        across = self.kernel(over, candidates) - to_o @ np.swapaxes(solved, 1, 2)
        prior = np.stack([np.diagonal(k) for k in self.kernel(candidates, candidates)])
        own = np.maximum(prior - np.einsum("tmi,tmi->tm", to_c, solved), 0.0) + self.sizes[:, 2, None]
        removed = np.einsum("t,tm->m", self.scale**2, np.sum(across**2, axis=1) / own)
        found: Array = np.clip(removed / max(float(self.variance(over).sum()), 1e-300), 0.0, 1.0)
        return found


def _likeliest(places: Array, column: Array) -> tuple[Array, Array, bool]:
    """Widths (d,), sizes (3,) and whether Matérn's kernel is the likelier of the two."""
    if not np.any(column):
        return np.full(places.shape[1], WIDTHS[1]), np.array([LARGEST, LARGEST, NOISE[0]]), False
    fits = [_fitted(places, column, rough) for rough in (False, True)]
    best = max(range(2), key=lambda i: (fits[i].log_marginal_likelihood_value_, -i))
    kernel = fits[best].kernel_
    stationary, plane, noise = kernel.k1.k1, kernel.k1.k2, kernel.k2
    widths = np.broadcast_to(stationary.k2.length_scale, places.shape[1]).astype(float)
    large, slope = stationary.k1.constant_value, plane.k1.constant_value
    sizes = np.array([large, slope, max(noise.noise_level, JITTER * (large + slope))])
    return widths, sizes, bool(best)


def _fitted(places: Array, column: Array, rough: bool) -> Any:
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, DotProduct, Matern, WhiteKernel

    start = np.full(places.shape[1], 2.0)
    shape = Matern(start, WIDTHS, nu=2.5) if rough else RBF(start, WIDTHS)
    plane = ConstantKernel(1.0, TREND) * DotProduct(1.0, "fixed")
    kernel = ConstantKernel(1.0, TREND) * shape + plane + WhiteKernel(1e-3, NOISE)
    with warnings.catch_warnings():
        # Widths at their bounds are meant: a parameter without effect gets the widest.
        warnings.simplefilter("ignore")
        return GaussianProcessRegressor(kernel, alpha=0.0, random_state=SEED).fit(places, column)
