"""The neural surrogate: a law of a small network from states, with errors on states left out and an error bar."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from pliant.interfaces.surrogate import FittedLaw, Surrogate
from pliant.records.design import Array
from pliant.records.error_bar import ErrorBar
from pliant.records.fem import FemDataset, ModuleData
from pliant.records.law import Domain, LawRecord
from pliant_plugins.surrogates.config import NeuralConfig
from pliant_plugins.surrogates.neural.law import KIND, NeuralLaw
from pliant_plugins.surrogates.neural.training import (
    EarlyStopping,
    ResidualSystem,
    Scales,
    States,
    library,
    train,
)
from pliant_plugins.surrogates.polynomial import scoring
from pliant_plugins.surrogates.polynomial.states import effort_ranges, split
from pliant_plugins.surrogates.polynomial.system import one_axis_joint
from pliant_plugins.surrogates.records import require_kind, stable_choice

# Candidates for the prior precision of parameters, as shares of the decay; the likeliest is taken.
BELIEFS = tuple(10.0**-e for e in range(2, 11))
# Misses grow less than the doubt does. Of 0.7, 0.8 and 1, bands of 28 bending designs hold 94, 91 and 84 % of states.
STEEPNESS = 0.7
# Points of the box at which the bar's shape is kept, as a power of 2, and how far each reaches, in their spacing.
PLACES, REACH = 8, 0.8
TINY = 1e-9  # of the range


def error_bar(
    states: States, scales: Scales, units: int, stop: EarlyStopping, misses: Array, part: NDArray[np.int64]
) -> ErrorBar:
    """Return the bar of a network from errors (n, k) of those trained without the part (n,) of each state.

    Laplace's approximation: parameters have the covariance (JᵀJ + Λ)⁻¹ about the network, J of the states it saw
    (MacKay, Neural Comput. 4, 1992). The size s of what it leaves open foretells the miss of a state left out as
    c s^`STEEPNESS`; the misses themselves give c, and Λ makes them likeliest.
    """
    torch = library()
    system = ResidualSystem(torch, states, scales, units, np.ones((1, len(part)), bool))
    theta = torch.from_numpy(stop.parameters[0])
    jacobian, own = system.jacobian(theta[None])[0], system.values(theta, states.points)
    state, d = system.known // system.rows, states.points.shape[1]
    box = np.stack([scales.centre - scales.half, scales.centre + scales.half], axis=1)
    at = 2 * qmc.Sobol(d, scramble=False).random_base2(PLACES) - 1
    places = system.values(theta, scales.centre + scales.half * at)
    shares = np.abs(misses) / scales.ranges
    best: tuple[float, Array, Array] | None = None
    for belief in BELIEFS:
        decay = belief / units * system.share
        foretold = np.empty_like(shares)
        for fold in range(part.max() + 1):
            seen = torch.from_numpy(np.flatnonzero(part[state] != fold))
            foretold[part == fold] = _sizes(torch, jacobian[seen], decay, own[part == fold])
        scores = np.maximum(shares, TINY) / np.maximum(foretold, TINY)
        size = np.sqrt(np.mean(scores**2, axis=0))
        likely = float(-np.sum(np.log(np.maximum(foretold, TINY) * size)))
        if best is None or likely > best[0]:
            best = likely, _sizes(torch, jacobian, decay, places), scores
    assert best is not None
    _, sizes, scores = best
    reach = REACH * 2 * len(at) ** (-1 / d)
    return ErrorBar.from_shape(box, at, sizes * scales.ranges, scores, reach)


def _sizes(torch: Any, jacobian: Any, decay: Any, values: Any) -> Array:
    """Return (n, k) predicted sizes, up to a factor, of errors where τ has the derivatives `values` (n, k, q)."""
    normal = jacobian.T @ jacobian
    normal.diagonal().add_(decay)
    factor = torch.linalg.cholesky(normal)
    flat = values.reshape(-1, values.shape[2])
    solved = torch.linalg.solve_triangular(factor, flat.T, upper=False)
    variances: Array = (solved * solved).sum(dim=0).reshape(values.shape[:2]).numpy()
    return np.asarray(variances ** (STEEPNESS / 2))


# Parts of the states that are left out in turn.
FOLDS = 4


class Neural(Surrogate):
    """Laws τ = −∂Π/∂u of a network Π(p, u), of one axis or of all that a joint has, of any inputs (`NeuralLaw`).

    torch trains the network (`training`); laws are loaded and evaluated by numpy. `FitReport.details` has the history
    of the training, the residuals, and for one axis the errors of the published form on the same states.
    """

    couples = True
    several_actuations = True
    gets_untrusted = True  # `states.split` judges them
    config: NeuralConfig

    def fit(self, data: FemDataset) -> FittedLaw:
        """Fit the states of role "fit" and score the law on those of role "check" (see `polynomial.states`).

        Raises `UserError`, in one sentence, for too few states, non-finite numbers and contradictions.
        """
        states = split(data, "a neural law")
        fit = states.fit
        points, tau = np.column_stack([fit.actuation, fit.angle_rad]), fit.moment_n_m[:, None]
        known = States(points, tau, fit.dmoment_dp[:, None], fit.dmoment_du[:, None, None])
        named = {"axes": (data.axis,), "joint": one_axis_joint(data), "actuation_name": data.actuation_name}
        law, details = self._trained(known, states.domain, effort_ranges(fit), named)
        return FittedLaw(law, scoring.report(law, states, details))

    def fit_module(self, data: ModuleData) -> FittedLaw:
        """Fit all axes of a joint together, with what moves one axis turning another; one axis as `fit` does.

        Of several actuations it is one energy of all of them.

        Raises `UserError` as `polynomial.states.split` does.
        """
        if len(data.axes) == 1 and len(data.actuations) == 1:
            return self.fit(data.axis(data.axes[0]))
        states = split(data, "a neural law")
        fit = states.fit
        points = np.column_stack([fit.actuation, fit.deformation])
        known = States(points, fit.tau, fit.dtau_dp, fit.dtau_du)
        named = {"axes": data.axes, "joint": data.joint, "actuation_name": data.actuation_name}
        law, details = self._trained(known, states.domain, states.ranges, named)
        return FittedLaw(law, scoring.report_axes(law, states, details, law.outside.largest_slope))

    def load(self, record: LawRecord) -> NeuralLaw:
        """Return the law of a record that `NeuralLaw.record` wrote."""
        require_kind(record, KIND)
        return NeuralLaw.from_record(record)

    def _trained(
        self, states: States, domain: Domain, ranges: Array, named: Mapping[str, Any]
    ) -> tuple[NeuralLaw, dict[str, Any]]:
        """Train on all states, and without each of `FOLDS` seeded parts; stop where those parts are met best.

        A law that is not stable in its whole box gives way to a stable one that is about as good. `named` are the
        law's axes, joint and actuation_name.
        """
        units, seed = self.config.units, self.config.seed
        scales = Scales.from_domain(domain, ranges)
        n = len(states.tau)
        part = np.random.default_rng(seed).permutation(n) % min(FOLDS, n)
        # the first network sees all states, each other one does without a part
        seen = np.concatenate([np.ones((1, n), bool), part != np.arange(part.max() + 1)[:, None]])
        stops = list(train(states, scales, units, seed, seen))
        misses = np.stack([_left_out(states, stop, part) for stop in stops])
        errors = np.sqrt(np.mean((misses / ranges) ** 2, axis=(1, 2)))
        laws = [NeuralLaw(stop.networks[0], domain, **named) for stop in stops]
        slopes = [law.outside.largest_slope for law in laws]
        chosen = stable_choice(errors.tolist(), slopes)
        error = error_bar(states, scales, units, stops[chosen], misses[chosen], part)
        law = replace(laws[chosen], error=error)
        history = [
            {
                "decay": stop.decay,
                "steps": int(stop.steps[0]),
                "residual_of_range": float(stop.residuals[0]),
                "left_out_rmse_of_range": float(missed),
                "stable": slope < 0,
                "chosen": k == chosen,
            }
            for k, (stop, missed, slope) in enumerate(zip(stops, errors, slopes, strict=True))
        ]
        return law, {
            "form": KIND,
            "units": units,
            "parameters": law.network.n_parameters,
            "decay": stops[chosen].decay,
            "training": history,
            "largest_slope": slopes[chosen],
            "stable": slopes[chosen] < 0,
        }


def _left_out(states: States, stop: EarlyStopping, part: NDArray[np.int64]) -> Array:
    """Return (n, k) predicted minus true effort of each state by the network trained without its part (n,)."""
    misses = np.empty_like(states.tau)
    for fold, network in enumerate(stop.networks[1:]):
        out = part == fold
        misses[out] = network.efforts(states.points[out])[0] - states.tau[out]
    return misses
