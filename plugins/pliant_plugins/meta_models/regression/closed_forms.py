"""Regressors with a closed form for designs left out: polynomials and kernel ridge."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pliant.records.design import Array

DEGREES = (1, 2, 3, 4)
RIDGES = tuple(10.0**power for power in range(-9, 1, 2))
WIDTHS = (0.5, 0.8, 1.2, 1.8, 2.7, 4.0)


@dataclass(frozen=True, eq=False)
class LinearSmoother:
    """z = centre + features(s) · weights: products of Legendre polynomials, or Gaussians about the solved designs.

    Attributes:
        kind: "polynomial" or "kernel_ridge".
        width: of the Gaussians.
        exponents: (f, d) degrees of the products.
        places: (n, d) centres of the Gaussians.
        centre: (q,); weights: (f, q) or (n, q).
    """

    kind: str
    width: float
    exponents: NDArray[np.int64]
    places: Array
    centre: Array
    weights: Array

    def mean(self, places: Array) -> Array:
        """(m, q) predicted targets at places (m, d)."""
        found: Array = self.centre + self.features(places) @ self.weights
        return found

    def features(self, places: Array) -> Array:
        """(m, f) at places (m, d)."""
        if self.kind == "polynomial":
            return legendre_products(places, self.exponents)
        return gaussians(places, self.places, self.width)


def fit_polynomial(places: Array, targets: Array) -> tuple[LinearSmoother, Array]:
    """Degree and ridge by the smallest error on designs left out one by one; and these errors (n, q)."""
    centre = targets.mean(axis=0)
    found = []
    for exponents in _degrees(places.shape[1], len(places)):
        x = legendre_products(places, exponents)
        degree = exponents.sum(axis=1).astype(float)
        for ridge in RIDGES:
            # High degrees are held more: they swing between the designs.
            gram = x.T @ x + ridge * len(x) * np.diag((1 + degree) ** 4)
            weights = np.linalg.solve(gram, x.T @ (targets - centre))
            hat = np.einsum("nf,fn->n", x, np.linalg.solve(gram, x.T))
            missed = (centre + x @ weights - targets) / np.maximum(1 - hat, 1e-6)[:, None]
            found.append((LinearSmoother("polynomial", 0.0, exponents, places[:0], centre, weights), missed))
    return min(found, key=lambda one: float(np.sum(one[1] ** 2)))


def fit_kernel_ridge(places: Array, targets: Array) -> tuple[LinearSmoother, Array]:
    """Width and ridge by the smallest error on designs left out one by one; and these errors (n, q)."""
    centre = targets.mean(axis=0)
    none = np.zeros((0, places.shape[1]), np.int64)
    found = []
    for width in WIDTHS:
        kernel = gaussians(places, places, width)
        for ridge in RIDGES:
            inverse = np.linalg.inv(kernel + ridge * np.eye(len(kernel)))
            weights = inverse @ (targets - centre)
            missed = -weights / np.diagonal(inverse)[:, None]
            found.append((LinearSmoother("kernel_ridge", width, none, places, centre, weights), missed))
    return min(found, key=lambda one: float(np.sum(one[1] ** 2)))


def gaussians(one: Array, two: Array, width: float) -> Array:
    """(m, n) exp(−|s − s'|² / (2 width²)) of places (m, d) and (n, d)."""
    apart = np.sum((one[:, None] - two[None]) ** 2, axis=2)
    found: Array = np.exp(-apart / (2 * width**2))
    return found


def legendre_products(places: Array, exponents: NDArray[np.int64]) -> Array:
    """(m, f) products of Legendre polynomials in each scaled parameter."""
    out = np.ones((len(places), len(exponents)))
    for i, degrees in enumerate(exponents.T):
        table = np.polynomial.legendre.legvander(places[:, i], int(degrees.max(initial=0)))
        out *= table[:, degrees]
    return out


def _degrees(d: int, designs: int) -> Iterator[NDArray[np.int64]]:
    """Products of total degree 1, 2 … while there are designs to tell them apart."""
    for degree in DEGREES:
        every = np.array([e for e in np.ndindex(*([degree + 1] * d)) if sum(e) <= degree], np.int64)
        if degree == 1 or len(every) < designs:
            yield every
