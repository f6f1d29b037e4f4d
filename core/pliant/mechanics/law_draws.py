"""Random draws of a law: the law plus smooth functions of the size of its error bar."""

from __future__ import annotations

from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
import scipy  # scipy.stats is needed only for draws of laws of several actuations
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from pliant.errors import UserError
from pliant.mechanics.law_wrapper import LawWrapper
from pliant.records.design import Array
from pliant.records.law import Effort, JointLaw

# Errors of a law vary slowly over its box: number of Chebyshev terms in p and in u, each half as large as the last.
TERMS = (3, 4)
DECAY = 0.5
# Number of nodes that resolve the error bar's shape.
NODES = 9
# Several actuations: degrees of a drawn function and of its product with the error bar, places of the fit.
SEVERAL, PLACES = (3, 4), 512
ONE_SIGMA = 2 * NormalDist().cdf(1.0) - 1


def error_tables(law: JointLaw, count: int, seed: int) -> Array:
    """Return (count, a, NODES, NODES) Chebyshev coefficients in (x, v_a) of drawn errors of the efforts, N·m.

    x and v are p and u scaled to [−1, 1] on the law's box. Each axis' error is a function of p and its own u, so
    that it derives from an energy: s_a(p, u_a) g(p, u_a), with s the band at one standard deviation (other axes at
    the centre of the box) and g a random Chebyshev series whose variance is 1 on average over the box.

    Raises:
        ValueError: the law states no error, or its domain has no limits.
    """
    box = np.vstack([law.domain.actuation, law.domain.deformation])
    if not law.states_error or not np.all(np.isfinite(box)) or len(law.actuations) > 1:
        raise ValueError("the law states no error bar over a bounded domain of one actuation")
    random = np.random.default_rng(seed)
    nodes = chebyshev.chebpts1(NODES)
    to_series = np.linalg.inv(chebyshev.chebvander(nodes, NODES - 1))
    tables = np.zeros((count, len(law.axes), NODES, NODES))
    for a in range(len(law.axes)):
        sizes = _sizes(law, box, a, nodes)
        for number in range(count):
            shape = _unit_function(random, nodes)
            tables[number, a] = to_series @ (sizes * shape) @ to_series.T
    return tables


def error_polynomials(law: JointLaw, count: int, seed: int) -> tuple[NDArray[np.int64], Array]:
    """Return drawn errors of a law of m actuations: exponents (t, m + 1) and coefficients (count, a, t), N·m.

    For each axis a polynomial in its scaled (p, u_a) replaces a table, which would have too many nodes: s_a g as in
    `error_tables`, g a random series of total degree 3, the product fitted by degree 4 at places that fill the box.

    Raises:
        ValueError: the law states no error, or its domain has no limits.
    """
    box, m = law.domain.box, len(law.actuations)
    if not law.states_error or not np.all(np.isfinite(box)):
        raise ValueError("the law states no error bar over a bounded domain")
    random = np.random.default_rng(seed)
    y = 2 * scipy.stats.qmc.Sobol(m + 1, scramble=False).random(PLACES) - 1
    exponents = np.array(
        [e for e in np.ndindex(*[SEVERAL[1] + 1] * (m + 1)) if sum(e) <= SEVERAL[1]], np.int64
    )
    to_polynomial = np.linalg.pinv(np.prod(y[:, None, :] ** exponents, axis=2))
    low = exponents[exponents.sum(axis=1) <= SEVERAL[0]]
    table = chebyshev.chebvander(y, SEVERAL[0])
    series = np.prod([table[:, d][:, low[:, d]] for d in range(m + 1)], axis=0) * DECAY ** low.sum(axis=1)
    series /= np.sqrt(np.mean(np.sum(series**2, axis=1)))
    centre, half = box.mean(axis=1), np.ptp(box, axis=1) / 2
    found = np.empty((count, len(law.axes), len(exponents)))
    for a in range(len(law.axes)):
        deformation = np.tile(centre[m:], (PLACES, 1))
        deformation[:, a] += half[m + a] * y[:, m]
        band = law.band(centre[:m] + half[:m] * y[:, :m], deformation, ONE_SIGMA)
        assert band is not None
        drawn = series @ random.standard_normal((len(low), count))
        found[:, a] = (to_polynomial @ (band[:, a, None] * drawn)).T
    return exponents, found


def draws(law: JointLaw, count: int, seed: int) -> tuple[JointLaw, ...]:
    """Return the draws that the law implements, or the law with drawn errors added.

    Raises:
        ValueError: as `error_tables`.
        UserError: a law of several actuations that does not implement draws.
    """
    own = law.draws(count, seed)
    if not own and len(law.actuations) > 1:
        raise UserError(
            f"laws of {law.actuation_name} can be drawn from their error bars where they are polynomials: use "
            "surrogate.kind 'polynomial' or meta_model.kind 'regression', or leave the uncertainty out."
        )
    return own or tuple(DrawnLaw(law, table) for table in error_tables(law, count, seed))


def _sizes(law: JointLaw, box: Array, a: int, nodes: Array) -> Array:
    """Return (NODES, NODES) one standard deviation of axis a over its p and u."""
    centre, half = box.mean(axis=1), np.ptp(box, axis=1) / 2
    p, u = np.meshgrid(centre[0] + half[0] * nodes, centre[1 + a] + half[1 + a] * nodes, indexing="ij")
    deformation = np.tile(centre[1:], (p.size, 1))
    deformation[:, a] = u.ravel()
    band = law.band(p.ravel(), deformation, ONE_SIGMA)
    assert band is not None
    return np.asarray(band[:, a].reshape(p.shape))


def _unit_function(random: np.random.Generator, nodes: Array) -> Array:
    """Return (NODES, NODES) values of a random series in x and v with a mean variance of 1."""
    weights = np.multiply.outer(DECAY ** np.arange(TERMS[0]), DECAY ** np.arange(TERMS[1]))
    bases = [chebyshev.chebvander(nodes, terms - 1) for terms in TERMS]
    variance = np.einsum("xi,vj,ij->xv", bases[0] ** 2, bases[1] ** 2, weights**2).mean()
    values: Array = bases[0] @ (weights * random.standard_normal(TERMS)) @ bases[1].T / np.sqrt(variance)
    return values


@dataclass(frozen=True, eq=False)
class DrawnLaw(LawWrapper):
    """A law plus an error e_a(p, u_a) on each axis; outside the box the error is that at its border.

    Attributes:
        law: the law itself.
        tables: (a, NODES, NODES) of `error_tables`.
    """

    tables: Array

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        """Return effort and slopes, shapes (n, a), (n, a), (n, a, a)."""
        effort = self.law.evaluate(actuation, deformation)
        tau, gain, slope = (np.array(part) for part in (effort.tau, effort.dtau_dp, effort.dtau_du))
        p_map = _map(self.law.domain.actuation)
        x, x_rate = _inside(np.asarray(actuation, float), p_map)
        for a, table in enumerate(self.tables):
            u_map = _map(self.law.domain.deformation[a])
            v, v_rate = _inside(np.asarray(deformation, float)[:, a], u_map)
            tau[:, a] += chebyshev.chebval2d(x, v, table)
            gain[:, a] += x_rate * chebyshev.chebval2d(x, v, chebyshev.chebder(table, axis=0))
            slope[:, a, a] += v_rate * chebyshev.chebval2d(x, v, chebyshev.chebder(table, axis=1))
        return Effort(tau, gain, slope)


def _map(limits: Array) -> tuple[float, float]:
    return float(limits.mean()), float(np.ptp(limits) / 2)


def _inside(values: Array, scale: tuple[float, float]) -> tuple[Array, Array]:
    """Return scaled values clipped to [−1, 1], and their derivative, 0 outside."""
    scaled = (values - scale[0]) / scale[1]
    held = np.clip(scaled, -1.0, 1.0)
    return held, np.where(scaled == held, 1.0 / scale[1], 0.0)
