"""Error of the joint law, which is part of every hypothesis.

The effort of a real module is τ(a, u) + δ(a, u), with actuation a, deformation u, and an unknown static error δ of the
law. Its prior is a Gaussian process with standard deviation s T,

    δ ~ GP(0, (s T)² mean_ℓ exp(−½ (Δa² + Δu²) / ℓ²)),

with Δa and Δu as shares of the visited ranges, ℓ from half to a sixth of them, T the torque range of the law, and s the
share of it by which the law may be off (Kennedy & O'Hagan, J. R. Stat. Soc. B 63, 2001; Brynjarsdóttir & O'Hagan,
Inverse Problems 30, 2014, on why its prior matters). δ is expanded in directions to which the readings are sensitive,
δ = T Σ c_j d_j with c_j ~ N(0, s²), and enters the readings to first order through their sensitivities B, which the
engine gives at each fit. With the weight w = n_eff / (N σ²) of a reading, its marginal likelihood is Gaussian with the
precision

    V⁻¹ = w (I − B (BᵀB + I / (w s²))⁻¹ Bᵀ).

A model of one's own has no law. Its numbers (masses, lengths, stiffness, …) are off by independent shares of them,
which enter the readings in the same way, with the sensitivities of the unchanged model.

The size s has a log-normal prior about the stated (`law_error` of a study) or the usual size, and is integrated over a
grid (`LawErrorPrior`); with probability `EXACT` the law has no error. δ cannot imitate effects with a memory, a clock,
or a shape that is not smooth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import cast

import numpy as np

from pliant.diagnosis.law_posterior import LawErrorPrior, Whitener, coefficient_precision
from pliant.diagnosis.learned_forms import KIND, LearnedForm, SeenMotion
from pliant.diagnosis.readings import ReadingVector
from pliant.errors import PliantError
from pliant.evidence.measured_model import MeasuredModel
from pliant.evidence.prediction import Predictor
from pliant.interfaces.effect import EffectConfig
from pliant.mechanics.learned_curve import CurveAxis
from pliant.records.chain import ChainModel
from pliant.records.design import Array

# Knots of δ along actuation and angle, and its correlation lengths, as shares of the visited ranges.
KNOTS = {"actuation": 7, "angle": 8}
LENGTHS = (0.5, 0.3, 0.18)
# The basis extends beyond the visited range by this share: other hypotheses visit other states.
BEYOND = 0.1
# Directions that change the readings by less than this (in noise floors, at the largest usual size) are dropped.
LEAST_FELT = 0.05
MOST_DIRECTIONS = 16
# Step of a coefficient for sensitivities, and of a number of a model as a share of it.
STEP, NUMBER_STEP = 1e-3, 1e-3
JITTER = 1e-8


@dataclass(frozen=True, eq=False)
class LawErrorBasis:
    """Directions of δ to which the readings are sensitive.

    Attributes:
        form: the surface over actuation and angle that represents δ.
        directions: (K, m) values at its knots, N·m or N, of each direction at the coefficient 1.
        effort: T, the torque range of the law.
    """

    form: LearnedForm
    directions: Array
    effort: float

    def __len__(self) -> int:
        return self.directions.shape[1]

    def effect(self, predictor: MeasuredModel, coefficient: Array) -> EffectConfig:
        """Return δ with these coefficients (m,) as an effect of a study."""
        block = self.form.block(self.directions @ coefficient)
        return self.config(predictor).model_validate(block)

    def config(self, predictor: MeasuredModel) -> type[EffectConfig]:
        """Return the config model of the effect that represents δ."""
        return cast(type[EffectConfig], predictor.context.registry.get("effect", KIND).config_model())


def effort_range(chain: ChainModel, axes: tuple[CurveAxis, ...]) -> float:
    """Return T: the largest effort over the visited actuations at rest and the visited deformations.

    Args:
        chain: the chain; its first law counts.
        axes: the visited ranges.
    """
    law = chain.laws[0]
    ends = {axis.name: np.array([axis.low, axis.high]) for axis in axes}
    efforts = []
    if "actuation" in ends:
        m = len(law.actuations)
        pushed = ends["actuation"] if m == 1 else np.repeat(ends["actuation"][:, None] / m, m, axis=1)
        efforts.append(law.evaluate(pushed, np.zeros((2, len(law.axes)))).tau)
    if "angle" in ends:
        for axis in range(len(law.axes)):
            bent = np.zeros((2, len(law.axes)))
            bent[:, axis] = ends["angle"]
            efforts.append(law.evaluate(law.unactuated(2), bent).tau[:, axis])
    finite = [np.abs(e[np.isfinite(e)]).max(initial=0.0) for e in efforts]
    return float(max(finite, default=0.0))


def law_error_basis(predictor: MeasuredModel) -> LawErrorBasis | None:
    """Return δ over the range that these runs visit; None for a model without a joint law, or if it cannot show."""
    if not isinstance(predictor, Predictor) or KIND not in predictor.context.registry.kinds("effect"):
        return None
    try:
        seen = SeenMotion(predictor)
    except PliantError:
        return None
    tried = [seen.axis(CurveAxis(name, 0.0, 1.0, knots)) for name, knots in KNOTS.items()]
    found = [axis for axis in tried if axis is not None]
    axes = tuple(axis for axis in found if axis.knots > 2)
    if not axes:
        return None
    effort = effort_range(predictor.chain, axes)
    if not effort > 0.0:
        return None
    wide = tuple(_wider(axis) for axis in axes)
    root = _prior_root(wide)
    return LawErrorBasis(LearnedForm("moment", wide), effort * root, effort)


def _wider(axis: CurveAxis) -> CurveAxis:
    """Return the axis with its range widened by `BEYOND` at both ends."""
    more = BEYOND * (axis.high - axis.low)
    low, high = (float(f"{end:.6g}") for end in (axis.low - more, axis.high + more))
    return CurveAxis(axis.name, low, high, axis.knots, axis.scale)


def _prior_root(axes: tuple[CurveAxis, ...]) -> Array:
    """Return L (K, K) with L Lᵀ the prior covariance of the values at the knots, for a unit standard deviation."""
    kernel: Array = np.zeros((1, 1))
    for length in LENGTHS:
        alone: Array = np.ones((1, 1))
        for axis in axes:
            at = np.linspace(-BEYOND, 1.0 + BEYOND, axis.knots)
            apart = (at[:, None] - at[None]) / length
            alone = np.asarray(np.kron(alone, np.exp(-0.5 * apart**2)), float)
        kernel = kernel + alone / len(LENGTHS)
    values, vectors = np.linalg.eigh(kernel + JITTER * np.eye(len(kernel)))
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


def strongest(basis: LawErrorBasis, columns: Array, most: float) -> tuple[LawErrorBasis, Array]:
    """Return the directions that the readings detect at the size `most`, orthogonal in the readings, and their columns.

    Args:
        basis: any directions with unit prior.
        columns: (N, K) change of the readings, in noise floors, per unit of each coefficient.
        most: a size, as a share of the torque range.
    """
    turn, kept = _felt(columns, most)
    return LawErrorBasis(basis.form, basis.directions @ turn, basis.effort), kept


def _felt(columns: Array, most: float) -> tuple[Array, Array]:
    """Return combinations (K, m) of coefficients that the readings detect at the size `most`, and their columns."""
    left, sizes, right = np.linalg.svd(columns, full_matrices=False)
    felt = most * sizes / np.sqrt(len(columns)) > LEAST_FELT
    felt[MOST_DIRECTIONS:] = False
    return right[felt].T, left[:, felt] * sizes[felt]


def number_error_columns(predictor: MeasuredModel, readings: ReadingVector, most: float) -> Array | None:
    """Return (N, m) the sensitivities of the readings to errors of a model's own numbers; None if they show none.

    The errors of the numbers, as shares of them, are independent and of one size, at most `most`: a smooth static error
    like that of a law, with another basis.
    """
    changes = predictor.number_sensitivities(NUMBER_STEP)
    if not changes:
        return None
    columns = np.stack([readings.pack(change) for change in changes], axis=1) / NUMBER_STEP
    _, kept = _felt(np.where(np.isfinite(columns), columns, 0.0), most)
    return kept if kept.shape[1] else None


@dataclass(frozen=True, eq=False)
class LawReference:
    """The law's error for fits before their sensitivities are known.

    Attributes:
        basis: its directions; None for errors of the numbers of a model of one's own.
        prior: of its size.
        columns: (N, m) sensitivities of the readings for the unchanged model.
        n_effective: independent readings.
    """

    basis: LawErrorBasis | None
    prior: LawErrorPrior
    columns: Array
    n_effective: float

    @property
    def precision(self) -> float:
        """Return the precision of each coefficient at the median size, for readings as noisy as their floors."""
        return self.precision_at(self.prior.median, self.n_effective)

    @cached_property
    def whitener(self) -> Whitener:
        """Return W of these sensitivities at that precision."""
        return Whitener.from_sensitivities(self.columns, self.precision)

    def largest_price(self, n_effective: float) -> float:
        """Return the expected log-odds penalty of an error of the largest size that the prior admits."""
        ratio = np.sum(self.columns**2, axis=0) / self.precision_at(self.prior.most, n_effective)
        logs = self.prior.log_weights
        return float(0.5 * np.sum(np.log1p(ratio) + ratio / (1.0 + ratio)) + logs.max() - logs[-1])

    def precision_at(self, size: float, n_effective: float) -> float:
        """Return the precision of each coefficient at a size, for readings as noisy as their floors."""
        return coefficient_precision(size, len(self.columns), n_effective, 1.0)


def law_columns(
    predictor: MeasuredModel, readings: ReadingVector, effects: Sequence[EffectConfig], basis: LawErrorBasis
) -> Array | None:
    """Return (N, m) d reading / d coefficient of the law's error, over the scales; None if the engine has none.

    Args:
        predictor: the model, driven by the runs of the readings.
        readings: positions and scales of the readings.
        effects: effects of the model in addition to the predictor's own.
        basis: directions of the law's error.
    """
    steps = STEP * np.eye(len(basis))
    towards = [(*effects, basis.effect(predictor, step)) for step in steps]
    zero = basis.effect(predictor, np.zeros(len(basis)))
    try:
        _, changes = predictor.vary((*effects, zero), towards)
    except PliantError:
        return None
    columns = np.stack([readings.pack(change) for change in changes], axis=1) / STEP
    return np.where(np.isfinite(columns), columns, 0.0)
