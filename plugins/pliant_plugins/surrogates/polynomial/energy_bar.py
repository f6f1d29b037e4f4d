"""The error bar of a polynomial energy: its shape from what the states leave open, its size from places left out."""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_triangular
from scipy.stats import qmc

from pliant.records.design import Array
from pliant.records.error_bar import ErrorBar
from pliant_plugins.surrogates.polynomial.energy import Exponents, unit
from pliant_plugins.surrogates.polynomial.energy_report import told_axes
from pliant_plugins.surrogates.polynomial.energy_system import EnergySystem, Solution

# Points of the box at which the bar's shape is kept, and how far each of them reaches.
PLACES = 512
REACH = 0.25
# States nearer to the border than this share of the half-width are on it.
BORDER = 1e-6
FEWEST_SCORES = 10


def error_bar(system: EnergySystem, terms: Exponents, solution: Solution) -> ErrorBar:
    """The bar whose shape is the predictive deviation of least squares (as `posterior.Posterior`).

    Scores are the misses of places left out over the deviation foretold for them, of all axes together: each axis
    where it is explored or held.
    """
    k = len(system.ranges)
    box = np.concatenate([system.domain.actuation[None], system.domain.deformation])
    places = 2 * qmc.Sobol(1 + k, scramble=False).random(PLACES) - 1
    sizes = shape(system, terms, box.mean(axis=1) + places * np.ptp(box, axis=1) / 2) * system.ranges
    told = told_axes(system.data)
    scores = (np.abs(solution.misses) / system.ranges / solution.doubts)[told]
    scores = scores[np.isfinite(scores)]
    if len(scores) < FEWEST_SCORES:
        return ErrorBar.of(box, system.data.actuation, system.data.deformation, solution.misses)
    return ErrorBar.of_shape(box, places, sizes, np.tile(scores[:, None], (1, k)), REACH)


def shape(system: EnergySystem, terms: Exponents, at: Array) -> Array:
    """(n, k) predictive deviation of τ over its range at p, u (n, 1 + k), for a noise of 1."""
    matrix = system.rows(terms)[0]
    norms = np.linalg.norm(matrix, axis=0)
    root = np.asarray(np.linalg.qr(matrix / norms, mode="r"))
    k, basis = len(system.ranges), system.basis(terms)
    found = np.empty((len(at), k))
    for i in range(k):
        rows = basis.derivative(at[:, 0], at[:, 1:], unit(k, 1 + i)) / (system.ranges[i] * norms)
        found[:, i] = np.sqrt(1 + np.sum(solve_triangular(root, rows.T, trans="T") ** 2, axis=0))
    return found
