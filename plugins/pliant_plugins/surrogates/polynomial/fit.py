"""The choice of a polynomial: degrees by cross-validation over levels of the data, or all terms under a prior."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pliant.errors import UserError
from pliant.records.fem import FemDataset
from pliant.records.law import Domain
from pliant_plugins.surrogates.polynomial.law import PolynomialLaw, largest_slope
from pliant_plugins.surrogates.polynomial.posterior import (
    CoefficientPosterior,
    CoefficientPrior,
    all_terms,
    fit_prior,
    solve,
)
from pliant_plugins.surrogates.polynomial.system import System, Terms
from pliant_plugins.surrogates.records import affordable

FAR_MORE = 5.0  # times the folds' error: such misses of fitted states count instead of it
# Errors below this share of the effort's range are all the same to everyone.
NEGLIGIBLE = 1e-10

# Number of additional degrees of the effort that energies and travels determine.
MORE_WITH_POTENTIAL = 3
# Spread states: errors up to this factor of the best set's error count as equal.
SPREAD_PATIENCE = 2.0


@dataclass(frozen=True, eq=False)
class Candidate:
    """One set of terms with its cross-validated error, as shares of the effort's range.

    `rmse_se` is the standard error of `rmse` over the folds; `law` is fitted to all states of role "fit", and so
    is `posterior`. With a `prior` the terms are shrunk by it, and `n_terms` is the effective number of free terms.
    """

    degree: int
    actuation_degree: int
    n_terms: int
    rmse: float
    rmse_se: float
    largest_slope: float
    law: PolynomialLaw
    posterior: CoefficientPosterior
    prior: CoefficientPrior | None = None

    @property
    def potential(self) -> bool:
        """Return whether energies and travels of the states were fitted."""
        return self.posterior.potential


def fit_adaptive(data: FemDataset, domain: Domain, max_degree: int) -> tuple[Candidate, list[Candidate]]:
    """Return the chosen candidate and all that the states determine.

    Of the sets of terms that the states determine by themselves, chosen is the one with the fewest terms whose
    error is within one standard error of the smallest. All terms of the largest degree, each held back by
    `posterior.prior_of`, take its place where their error is the smallest by a standard error, or, for states that
    are spread and stand on no grid, not much larger: there folds leave out corners and contain little information
    on the inside.
    Where states know their energy and travel, the same terms fitted to those too compete with them.
    Both are chosen among the laws that are stable over the whole domain if one of them is about as good as the
    best: polynomials swing where a box has no data, while a module that really snaps through keeps its instability,
    which is reported. Deterministic. Raises `UserError` when the states do not determine even a plane.
    """
    system = System(data, domain)
    sets = _term_sets(max_degree, *system.few)
    candidates = [c for terms in sets if (c := _candidate(system, *terms)) is not None]
    if not candidates:
        raise UserError(
            f"the {len(data)} states lie on one line of {data.actuation_name} and angle_rad and determine no "
            "law: add states at other angles under the same actuation"
        )
    held = _held_back(system, max_degree)
    candidates += held
    best = min(candidates, key=lambda c: c.rmse)
    stable = [c for c in candidates if c.largest_slope < 0]
    eligible = stable if any(c.rmse <= affordable(best.rmse) for c in stable) else candidates
    return _choose(eligible), candidates


def _choose(eligible: list[Candidate]) -> Candidate:
    plain = [c for c in eligible if c.prior is None]
    if not plain:
        return min(eligible, key=lambda c: c.rmse)
    best = min(plain, key=lambda c: c.rmse)
    limit = best.rmse + best.rmse_se + NEGLIGIBLE
    chosen = min((c for c in plain if c.rmse <= limit), key=lambda c: (c.n_terms, c.rmse))
    grid = chosen.posterior.system.grid
    bound = best.rmse - best.rmse_se if grid else SPREAD_PATIENCE * chosen.rmse
    held = [c for c in eligible if c.prior is not None and c.rmse < bound]
    return min(held, key=lambda c: c.rmse, default=chosen)


def _held_back(system: System, max_degree: int) -> list[Candidate]:
    """Fit all terms under their prior, if the data have enough levels to determine their smoothness."""
    if any(system.few):
        return []
    sets = [all_terms(max_degree)]
    if np.isfinite(system.travel).any():
        sets.append(all_terms(max_degree + MORE_WITH_POTENTIAL, potential=True))
    degrees = [int(terms[:, 1].max()) for terms in sets]
    found = [
        _candidate(system, degree, degree, terms, fit_prior(system, terms))
        for degree, terms in zip(degrees, sets, strict=True)
    ]
    return [candidate for candidate in found if candidate is not None]


def _term_sets(max_degree: int, few_x: bool, few_v: bool) -> Iterator[tuple[int, int, Terms]]:
    """Yield the exponents (i, j) of x^i v^j with i/I + j/J ≤ 1: total degree, and half the degree in the actuation.

    If the data have few levels of a coordinate, all terms are linear in it, and total degree with that limit is added:
    the other two contain a product x v only together with squares of both.
    """
    seen = set()
    for degree in range(1, max_degree + 1):
        half = (degree + 1) // 2
        most = (1 if few_x else degree, 1 if few_v else degree)
        full = [(i, j) for i in range(degree + 1) for j in range(degree + 1)]
        sets = [[(i, j) for i, j in full if i * degree + j * top <= top * degree] for top in (degree, half)]
        if few_x or few_v:
            limited = [(i, j) for i, j in sets[0] if i <= most[0] and j <= most[1]]
            sets = [pairs for pairs in sets if set(pairs) <= set(limited)] + [limited]
        for pairs in sets:
            if tuple(pairs) not in seen:
                seen.add(tuple(pairs))
                yield degree, max(i for i, _ in pairs), np.array(pairs)


def _candidate(
    system: System, degree: int, actuation_degree: int, terms: Terms, prior: CoefficientPrior | None = None
) -> Candidate | None:
    """Cross-validate one set of terms; None where the states of any fold do not determine all its terms."""
    matrix, right, state = system.rows(terms)
    n = len(system.x)
    squares = []
    for left_out in system.folds:
        train = ~left_out[state]
        solution = solve(matrix[train], right[train], prior)
        if solution is None:
            return None
        squares.append((matrix[:n][left_out] @ solution - right[:n][left_out]) ** 2)
    posterior = CoefficientPosterior.from_system(system, terms, prior)
    if posterior is None:
        return None
    solution = posterior.solution
    rmse = float(np.sqrt(np.concatenate(squares).mean()))
    # few levels: states that are never left out, at the box's corners, may show errors that the folds miss
    kept = ~np.any(system.folds, axis=0)
    if kept.any():
        missed = float(np.sqrt(np.mean((matrix[:n][kept] @ solution - right[:n][kept]) ** 2)))
        rmse = missed if missed > FAR_MORE * rmse else rmse
    spread = float(np.std([fold.mean() for fold in squares]) / np.sqrt(len(squares)))
    law = system.law(terms, solution)
    standard_error = spread / (2 * rmse) if rmse else 0.0
    steepest = largest_slope(law)
    count = len(terms) if prior is None else round(posterior.effective_terms())
    return Candidate(degree, actuation_degree, count, rmse, standard_error, steepest, law, posterior, prior)
