"""What of the published gripper's set-up is not published, and which values the egg's cells make likely.

A cell's share of successes is taken as Φ(a + b·z): z are the unknowns in units of their plausible spread, from the
nominal values; b is common to all cells, a is each cell's own. This probit model is fitted to simulated counts of sets
that are drawn from the prior, z ~ N(0, 1). The set that is chosen has the largest posterior density given the egg's
measured counts: it moves every value by as little as explains them. Nothing here reads a cell of the cylinder.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize
from scipy.special import log_ndtr, ndtr, ndtri
from scipy.stats import qmc

from pliant.records.design import Array

WIDEST = 2.0  # standard deviations beyond which no value is taken


@dataclass(frozen=True)
class Unknown:
    """A value of the set-up that is not published: what we take, how far it may be off, and why.

    `levels` are the only values that it may take, where each costs a finite-element solution.
    """

    name: str
    nominal: float
    spread: float
    unit: str
    why: str
    levels: tuple[float, ...] = ()

    def others(self) -> tuple[float, ...]:
        """A value below and one above, for sensitivities."""
        if self.levels:
            return tuple(level for level in self.levels if level != self.nominal)
        return (self.nominal - self.spread, self.nominal + self.spread)

    def at(self, standard: float) -> float:
        """The value at so many standard deviations from the nominal one."""
        value = self.nominal + self.spread * min(max(standard, -WIDEST), WIDEST)
        if self.levels:
            return min(self.levels, key=lambda level: abs(level - value))
        return value


UNKNOWNS = (
    Unknown("base_radius", 14e-3, 1.5e-3, "m", "to the plate's mid-plane, or to one of its faces"),
    Unknown("grasp_height", 8e-3, 3e-3, "m", "of the tip's edge, or of its middle, sagging or straight"),
    Unknown(
        "friction", 0.8, 0.15, "", "stated for the simulation; that of rubber on the objects is not measured"
    ),
    Unknown("inclination", 30.0, 2.0, "deg", "printed mount"),
    Unknown(
        "shear_modulus",
        249e3,
        8e3,
        "Pa",
        "material not published; fitted to a curve",
        (240.5e3, 249e3, 257e3),
    ),
    Unknown("weights_height", 0.5, 0.2, "of the height", "where the extra weights are in the object"),
    Unknown("pressure_noise", 0.5e3, 0.25e3, "Pa", "half width, or that of the same standard deviation"),
    Unknown("placement_noise", 0.05, 0.025, "of the radius", "radius of the disc, or a standard deviation"),
    Unknown("foot_radius", 8e-3, 3e-3, "m", "what the egg stands on"),
)
LARGEST_SLOPE = 3.0  # prior of the probit model's slopes, so that separated counts leave them finite
NOMINAL = {unknown.name: unknown.nominal for unknown in UNKNOWNS}


def drawn(count: int, seed: int, centre: Array | None = None, width: float = 1.0) -> Array:
    """(count, unknowns) standardised sets by a scrambled Sobol sequence, around a centre; count is a power of two."""
    uniform = qmc.Sobol(len(UNKNOWNS), seed=seed).random(count)
    tail = float(ndtr(-WIDEST))
    around: Array = ndtri(tail + (1.0 - 2.0 * tail) * uniform)
    return np.clip((0.0 if centre is None else centre) + width * around, -WIDEST, WIDEST)


def setup_of(z: Array) -> dict[str, float]:
    """The values of a standardised set."""
    return {u.name: u.at(float(value)) for u, value in zip(UNKNOWNS, z, strict=True)}


def standardised(setup: Mapping[str, float]) -> Array:
    """The inverse of `setup_of`, levels as they are."""
    return np.array([(setup[u.name] - u.nominal) / u.spread for u in UNKNOWNS])


@dataclass(frozen=True)
class Probit:
    """Φ(a_c + b·z): intercepts of the cells, common slopes."""

    intercepts: Array
    slopes: Array

    @staticmethod
    def fitted(z: Array, successes: Array, trials: int) -> Probit:
        """Maximum likelihood with a weak prior, from counts (sets, cells) of `trials` at sets (sets, unknowns)."""
        cells, unknowns = successes.shape[1], z.shape[1]

        def loss(theta: Array) -> float:
            margin = theta[:cells] + (z @ theta[cells:])[:, None]
            fit = successes * log_ndtr(margin) + (trials - successes) * log_ndtr(-margin)
            return float(-fit.sum() + 0.5 * np.sum((theta / LARGEST_SLOPE) ** 2))

        theta = minimize(loss, np.zeros(cells + unknowns), method="BFGS").x
        return Probit(theta[:cells], theta[cells:])

    def posterior(self, measured: Array, of: int) -> tuple[Array, Array]:
        """Mode (unknowns,) of z given the cells' measured counts, and its covariance by Laplace."""

        def loss(z: Array) -> float:
            margin = self.intercepts + self.slopes @ z
            fit = measured * log_ndtr(margin) + (of - measured) * log_ndtr(-margin)
            return float(-fit.sum() + 0.5 * z @ z)

        found = minimize(loss, np.zeros(len(self.slopes)), method="BFGS")
        return np.clip(found.x, -WIDEST, WIDEST), np.asarray(found.hess_inv)
