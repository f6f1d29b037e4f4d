"""The fit of a common form: scales, terms, coefficients of all designs at once, stability, principal components."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pliant.errors import UserError
from pliant.records.design import Array
from pliant_designs.meta_models.common_form import CommonForm
from pliant_designs.meta_models.common_form_scales import (
    ParameterMap,
    Trends,
    degree_for,
    design_sizes,
    fitted,
    monomials,
    turned,
)
from pliant_designs.meta_models.common_form_stable import StabilityGrid
from pliant_designs.meta_models.common_form_terms import (
    Equations,
    equations,
    is_even,
    orthonormal,
    scaled_basis,
    term_sets,
)
from pliant_designs.records import SolvedDesigns
from pliant_plugins.surrogates.polynomial.energy import Exponents, unit

ROUNDS = 12
# Relative accuracy below which no data are accepted.
NOISE_FLOOR = 1e-5
# Share of the mean variance that every direction keeps.
SPREAD_FLOOR = 1e-8
# Weight, in designs, of the prior that coefficients fall with the degree.
BELIEF = 1.0
# Weight, in equations of typical noise, of the prior on each design's noise.
TYPICAL = 10.0


@dataclass(frozen=True, eq=False)
class Population:
    """Coefficients c_i ~ N(B h(s_i), Σ) of designs with states rows_i · c_i = right_i ± σ_i.

    Empirical Bayes by expectation and maximisation (Laird and Ware, Biometrics 38, 1982): B, Σ and σ_i come from all
    designs together; a design's coefficients are the posterior mean. A direction that its states do not determine
    keeps what its parameters suggest.

    Attributes:
        coefficients: (n, m) posterior means.
        mean: (t, m) B.
        spread: (m, m) Σ.
        noise: (n,) σ of each design.
    """

    coefficients: Array
    mean: Array
    spread: Array
    noise: Array


def fit_population(
    designs: Sequence[Equations], h: Array, rounds: int = ROUNDS, held: Array | None = None
) -> Population:
    """Fit the population of designs with equations in well-scaled terms; h (n, t) are regressors of their mean.

    `held` (m, m) is a precision about zero that every design has in addition to its equations.
    """
    n, m = len(designs), designs[0].rows.shape[1]
    grams = [one.rows.T @ one.rows for one in designs]
    moments = [one.rows.T @ one.right for one in designs]
    squares = np.array([float(one.right @ one.right) for one in designs])
    counts = np.array([len(one.right) for one in designs])
    scale = float(squares.sum() / max(counts.sum(), 1))
    held = np.zeros((m, m)) if held is None else held
    first = np.linalg.solve(sum(grams) + 1e-6 * counts.sum() / m * np.eye(m), sum(moments))
    mean = np.zeros((h.shape[1], m))
    mean[0] = first
    noise = np.full(n, 0.01 * np.sqrt(scale))
    prior = scale * np.diag((1.0 + np.arange(m)) ** -2.0)
    now = Population(np.tile(first, (n, 1)), mean, prior, noise)
    for _ in range(rounds):
        found = [
            _posterior(g, b, row @ now.mean, now.spread, s, held)
            for g, b, row, s in zip(grams, moments, h, now.noise, strict=True)
        ]
        c = np.array([mean_of for mean_of, _ in found])
        mean = np.linalg.solve(h.T @ h + 1e-6 * n * np.eye(h.shape[1]), h.T @ c)
        apart = c - h @ mean
        spread = (apart.T @ apart + sum(cov for _, cov in found) + BELIEF * prior) / (n + BELIEF)
        spread += SPREAD_FLOOR * np.trace(spread) / m * np.eye(m)
        missed = np.array(
            [
                float(np.sum((one.right - one.rows @ ci) ** 2)) + float(np.sum(g * cov))
                for one, ci, g, (_, cov) in zip(designs, c, grams, found, strict=True)
            ]
        )
        now = Population(c, mean, spread, _noise(missed, counts, NOISE_FLOOR**2 * scale))
    return now


def _noise(missed: Array, counts: NDArray[np.int64], floor: float) -> Array:
    """Return (n,) noise of each design, shrunk to the typical one with the weight of `TYPICAL` equations."""
    typical = float(np.median(missed / np.maximum(counts, 1)))
    return np.sqrt(np.maximum((missed + TYPICAL * typical) / (counts + TYPICAL), floor))


def _posterior(
    gram: Array, moment: Array, prior: Array, spread: Array, noise: float, held: Array
) -> tuple[Array, Array]:
    """Return mean and covariance of one design's coefficients."""
    precision = gram / noise**2 + np.linalg.inv(spread) + held
    covariance = np.asarray(np.linalg.inv((precision + precision.T) / 2), float)
    return prior + covariance @ ((moment - gram @ prior) / noise**2 - held @ prior), covariance


# Directions that move no effort by more than this share of its mean size are left out.
NEGLIGIBLE = 2e-5
MOST_TARGETS = 24
# Prior bound of stiffnesses in efforts per reach, and the number of places along an axis at which it is imposed.
STIFFNESS = 5.0
CORNERS = 3


def fit_common_form(designs: SolvedDesigns) -> tuple[CommonForm, Array]:
    """Fit the form and the targets (n, q) of the designs to trusted states of role "fit".

    Deterministic. Raises `UserError` for a design without such states.
    """
    first = designs.data[0]
    main = first.axes.index(first.main_axis)
    _enough_states(designs)
    parameters = ParameterMap.from_designs(designs.values)
    places = parameters(designs.values)
    sizes = Trends.fit(places, np.log(design_sizes(designs)))
    seen = np.concatenate([data.actuation[fitted(data)] for data in designs.data])
    actuation = np.stack([seen.min(axis=0), seen.max(axis=0)], axis=-1)
    scale = np.abs(actuation).max(axis=-1)
    own = np.exp(sizes(places))
    weights, ranges = _weights(designs, own)
    even = is_even(designs.data, ranges)

    def term_equations(exponents: Exponents) -> list[Equations]:
        return [
            equations(data, exponents, scale, size, weights)
            for data, size in zip(designs.data, own, strict=True)
        ]

    extent, boxes = _boxes(designs, own)
    box = np.vstack([(actuation.T / scale).T, extent])

    def held(exponents: Exponents) -> Array:
        return _held_stiffness(exponents, box, main, weights)

    h = monomials(places, degree_for(*places.shape))
    sets = term_sets(len(first.axes), main, even, len(first.actuations))
    exponents, errors = chosen_terms(sets, term_equations, h, held, alike=len(first.actuations) > 1)
    blocks = term_equations(exponents)
    lift = orthonormal(blocks)
    raised = [one.lifted(lift) for one in blocks]
    kept = lift.T @ held(exponents) @ lift
    population = fit_population(raised, h, held=kept)
    margin = _rest_stiffness(population, lift, exponents, len(first.axes))
    grid = StabilityGrid.from_box(exponents, box, main, margin).transformed(lift)
    coefficients = _all_stable(population, raised, grid, boxes, kept)
    centre, directions = _principal(coefficients)
    targets = (coefficients - centre) @ directions
    details = {
        "terms": len(exponents),
        "targets": directions.shape[1],
        "even": even,
        "state_errors": errors,
        "noise": float(np.median(population.noise)),
    }
    form = CommonForm(
        parameters,
        sizes,
        exponents,
        centre=lift @ centre,
        directions=lift @ directions,
        reference=targets,
        solved=places,
        edges=_edges(places, boxes),
        extent=extent,
        margin=margin,
        spread=targets.std(axis=0),
        actuation=actuation,
        axes=first.axes,
        main=main,
        joint=first.joint,
        actuation_name=first.actuation_name,
        details=details,
    )
    return form, targets


def _enough_states(designs: SolvedDesigns) -> None:
    for number, data in enumerate(designs.data):
        good = fitted(data)
        if good.sum() < 2:
            raise UserError(
                f"design {number + 1} of {len(designs)} has {int(good.sum())} trusted states of role 'fit', and at "
                "least 2 are needed: leave it out of the sweep, or let its walls pass (fem.self_contact: pass) or "
                "hold each other (solve)"
            )


def _weights(designs: SolvedDesigns, sizes: Array) -> tuple[Array, Array]:
    """Return (k,) weights of the axes, one over their mean scaled effort, and (k,) largest efforts."""
    means, ranges = [], []
    for data, size in zip(designs.data, sizes, strict=True):
        good = fitted(data)
        scaled = data.tau[good] * size[:-1] / size[-1]
        means.append(np.sqrt(np.mean(scaled**2, axis=0)))
        ranges.append(np.abs(data.tau[good]).max(axis=0))
    typical = np.median(means, axis=0)
    return 1 / np.where(typical > 0, typical, 1.0), np.max(ranges, axis=0)


def _boxes(designs: SolvedDesigns, sizes: Array) -> tuple[Array, Array]:
    """Return (k, 2) scaled deformations of all designs together, and (n, k, 2) of each (`turned`)."""
    pairs = zip(designs.data, sizes, strict=True)
    every = np.array([np.stack(turned(data), axis=1) / size[:-1, None] for data, size in pairs])
    return np.stack([every[:, :, 0].min(axis=0), every[:, :, 1].max(axis=0)], axis=1), every


def _edges(places: Array, boxes: Array) -> Trends:
    """Fit the boxes (n, k, 2) over scaled parameters, wide enough for those of all designs."""
    edges = boxes.reshape(len(places), -1)
    found = Trends.fit(places, edges, least_gain=1.0)
    missed = edges - found(places)
    coefficients = found.coefficients.copy()
    coefficients[0, 0::2] += missed[:, 0::2].min(axis=0)
    coefficients[0, 1::2] += missed[:, 1::2].max(axis=0)
    return replace(found, coefficients=coefficients)


def _held_stiffness(exponents: Exponents, box: Array, main: int, weights: Array) -> Array:
    """Return the (m, m) prior that stiffnesses in the box have the size of the efforts within `STIFFNESS` times.

    Corners where several axes are far out have no states; without it, polynomials of several axes are anything there.
    One axis under one actuation has states all over its box, and needs none.
    """
    m, k = len(exponents), len(weights)
    if exponents.shape[1] == 2:
        return np.zeros((m, m))
    slopes = StabilityGrid.from_box(exponents, box, main, np.ones(k)).slopes
    weighed = slopes * np.sqrt(weights[:, None] * weights)[:, :, None] / STIFFNESS
    rows = weighed.reshape(-1, m)
    return CORNERS**k / len(slopes) * rows.T @ rows


def _rest_stiffness(population: Population, lift: Array, exponents: Exponents, k: int) -> Array:
    """Return (k,) median over the designs of −∂τ/∂u at rest, scaled; positive."""
    m = exponents.shape[1] - k
    rest, at = scaled_basis(exponents), (np.zeros((1, m)), np.zeros((1, k)))
    rows = [rest.derivative(*at, unit(m + k, m + i, m + i))[0] for i in range(k)]
    found = np.median(population.coefficients @ lift.T @ np.array(rows).T, axis=0)
    return np.asarray(np.where(found > 0, found, np.abs(found) + 1e-12), float)


def _all_stable(
    population: Population, blocks: list[Equations], grid: StabilityGrid, boxes: Array, held: Array
) -> Array:
    """Return (n, m) coefficients of the designs, each moved as little as its data allow until stable."""
    prior = np.linalg.inv(population.spread) + held
    found = []
    for own, one, box, noise in zip(population.coefficients, blocks, boxes, population.noise, strict=True):
        keep = grid.inside(box)
        if not grid.stable(grid.at(own, keep)):
            precision = one.rows.T @ one.rows / noise**2 + prior
            own = grid.nearest(own, precision, keep)
        found.append(own)
    return np.array(found)


def _principal(coefficients: Array) -> tuple[Array, Array]:
    """Return mean (m,) and orthonormal directions (m, q) of coefficients (n, m), without negligible ones."""
    centre = coefficients.mean(axis=0)
    _, sizes, directions = np.linalg.svd(coefficients - centre, full_matrices=False)
    left = np.sqrt(np.cumsum(sizes[::-1] ** 2)[::-1] / len(coefficients))
    count = int(np.clip(np.sum(left > NEGLIGIBLE), 1, MOST_TARGETS))
    return centre, directions[:count].T


LEFT_OUT = 0.25
SEED = 0
ROUNDS_OF_CHOICE = 6
# Of several axes smaller sets win within this factor of the best error; of one axis, where all are small, none does.
WITHIN = 1.15
# Sets after two that are worse than the best by this factor are not tried.
HOPELESS = 3.0
# The share of the effort's size that suffices.
ENOUGH = 2e-4


def chosen_terms(
    sets: Sequence[Exponents],
    of_terms: Callable[[Exponents], list[Equations]],
    h: Array,
    held: Callable[[Exponents], Array],
    alike: bool = False,
) -> tuple[Exponents, list[float]]:
    """Choose the exponents by cross-validation; return them and the error of each set tried.

    A seeded quarter of the states of every design is left out; the error is the root mean square of the efforts'
    residual there, after a fit of all designs to the other states, as a share of the effort's mean size.

    `alike`: states of all designs are at the same places of their boxes, as a sweep under several actuations samples
    them; then the same ones are left out of all designs, so that none informs another there.
    """
    errors: list[float] = []
    for exponents in sets:
        errors.append(_error(of_terms(exponents), h, held(exponents), alike))
        if errors[-1] < ENOUGH:
            break
        if len(errors) > 2 and min(errors[-2:]) > HOPELESS * min(errors):
            break
    within = WITHIN if sets[0].shape[1] > 2 else 1.0
    first = next(i for i, error in enumerate(errors) if error <= max(within * min(errors), ENOUGH))
    return sets[first], errors


def _error(blocks: list[Equations], h: Array, held: Array, alike: bool) -> float:
    random = np.random.default_rng(SEED)
    kept, left = [], []
    for one in blocks:
        n = int(one.state.max()) + 1
        random = np.random.default_rng(SEED) if alike else random
        out = np.zeros(n, bool)
        out[random.permutation(n)[: int(LEFT_OUT * n)]] = True
        kept.append(one.select_states(~out))
        left.append(one.select_states(out))
    lift = orthonormal(kept)
    population = fit_population([one.lifted(lift) for one in kept], h, ROUNDS_OF_CHOICE, lift.T @ held @ lift)
    missed = [
        (one.right - one.rows @ (lift @ own))[one.value]
        for one, own in zip(left, population.coefficients, strict=True)
    ]
    together = np.concatenate(missed)
    return float(np.sqrt(np.mean(together**2))) if together.size else 0.0
