"""All terms of the largest degree at once, each held back by how smooth the data say the law is."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import lgamma

import numpy as np

from pliant.records.design import Array
from pliant_plugins.surrogates.polynomial.system import System, Terms

# Candidates of the radii ρ and of the noise, as variances against the prior's. Below the smallest the data's own
# rounding (an FEM mesh, a solver's tolerance) would be fitted.
RADII = ((0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0), (0.5, 1.0, 1.5, 2.0, 3.0, 4.0))
NOISES = tuple(10.0**power for power in range(-10, 1))


@dataclass(frozen=True, eq=False)
class Prior:
    """Standard deviations (k,) of the terms and the noise's variance, both in units of one common scale.

    Attributes:
        radii: ρ_p, ρ_u.
    """

    deviations: Array
    noise: float
    radii: tuple[float, float]


def all_terms(degree: int, potential: bool = False) -> Terms:
    """Exponents of all terms up to a total degree; with `potential` those that bear no effort too (`System.rows`)."""
    efforts = [(i, j) for i in range(degree + 1) for j in range(degree + 1 - i)]
    return np.array(efforts + [(i, -1) for i in range(degree + 2) if potential])


def prior_of(system: System, terms: Terms) -> Prior:
    """The prior under which the data are most likely.

    Coefficients c_ij of Chebyshev terms are normal with deviations s ρ_p^−i ρ_u^−j / √(i + j)!, those of total
    degree 0 and 1 with s: functions as smooth as those of a Gaussian kernel, whose Taylor coefficients fall like
    that. The rows have normal noise. s is eliminated; ρ_p, ρ_u and the noise maximise the evidence (MacKay, Neural
    Computation 4, 1992) over `RADII` and `NOISES`.
    """
    matrix, right, _ = system.rows(terms)
    m = len(right)
    # An orthogonal change of the rows leaves the evidence: k + 1 rows tell as much as m.
    compact: Array = np.asarray(np.linalg.qr(np.column_stack([matrix, right]), mode="r"))
    best: tuple[float, Prior] | None = None
    for radii, deviations in _deviations(terms):
        scaled = compact[:, :-1] * deviations
        variances, basis = np.linalg.eigh(scaled @ scaled.T)
        inner = (basis.T @ compact[:, -1]) ** 2
        for noise in NOISES:
            total = np.maximum(variances, 0.0) + noise
            scale = np.sum(inner / total) / m
            evidence = -0.5 * (m * np.log(scale) + np.log(total).sum() + (m - len(total)) * np.log(noise))
            if best is None or evidence > best[0]:
                best = evidence, Prior(deviations, noise, radii)
    assert best is not None
    return best[1]


def _deviations(terms: Terms) -> Iterator[tuple[tuple[float, float], Array]]:
    i, j = terms.T
    factorial = np.exp([lgamma(max(degree, 0) + 1) / 2 for degree in terms.sum(axis=1)])
    for along_p in RADII[0]:
        for along_u in RADII[1]:
            deviations = along_p ** -i.astype(float) * along_u ** -j.astype(float) / factorial
            deviations[i + j <= 1] = deviations[j >= 0].max()
            yield (along_p, along_u), deviations
