"""Comparison of a model's trials with counted trials: conditions that disagree beyond chance, and repeats that do.

Both sides are finite: s of n measured, t of m simulated. The log-likelihood of a condition is that of the measured
count given the simulated one (`binomial.log_predictive`); its test is Fisher's exact one, adjusted for the number of
conditions by Holm. Sets of one condition are tested against each other in the same way: contradictory repeats are a
finding about the test rig, reported before any about the model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import scipy

from pliant_counts.binomial import (
    Count,
    chi_square,
    deviance,
    fisher_p,
    holm,
    log_bayes_factor,
    log_own,
    log_predictive,
    repeats_agree,
    signed_z,
    wilson,
)
from pliant_counts.records import CountCondition, Counts

LEVEL = 0.05


@dataclass(frozen=True)
class ConditionResult:
    """One condition.

    Attributes:
        condition: what was set and measured.
        simulated: successes and trials of the model.
        log_likelihood: of the measured count given the simulated one.
        deviance: twice the log-likelihood lost against the best possible simulated count; ≥ 0.
        log_bayes_factor: one probability for both over one each; negative values are evidence against the model.
        p: Fisher's exact test; `p_adjusted` after Holm over all conditions.
        z: its normal score, positive where more succeeded than in the model.
        p_repeats: of the sets having one probability, 1 for a single set; `p_repeats_adjusted` after Holm.
        share_of_error: of the total deviance.
    """

    condition: CountCondition
    simulated: Count
    log_likelihood: float
    deviance: float
    log_bayes_factor: float
    p: float
    p_adjusted: float
    z: float
    p_repeats: float
    p_repeats_adjusted: float
    share_of_error: float

    @property
    def measured(self) -> Count:
        """Return successes and trials over all sets."""
        return self.condition.successes, self.condition.trials

    @property
    def disagrees(self) -> bool:
        """Return whether the model differs from the measurement by more than chance, adjusted for all conditions."""
        return self.p_adjusted < LEVEL

    @property
    def contradictory(self) -> bool:
        """Return whether the sets of this condition differ by more than chance, adjusted for all conditions."""
        return self.p_repeats_adjusted < LEVEL

    @property
    def error(self) -> float:
        """Return the measured minus the simulated share of successes."""
        return self.measured[0] / self.measured[1] - self.simulated[0] / self.simulated[1]

    @property
    def interval(self) -> tuple[float, float]:
        """Return the 95 % interval of the measured share (Wilson)."""
        return wilson(self.measured)


@dataclass(frozen=True)
class CountComparison:
    """A comparison of counts under all conditions.

    Attributes:
        conditions: in the file's order.
        log_likelihood, deviance: sums over the conditions.
        log_likelihood_own: of a model with a separate uniform probability for every condition: the value that an
            informative model has to exceed.
        rmse: root mean square of the differences of shares; `bias` their mean.
        noise_floor: the expected `rmse` if model and measurement had the same probabilities.
        overdispersion: χ² of the repeats per degree of freedom, where at least one condition repeats; else NaN.
        p_overdispersion: of sets that scatter binomially, by that χ²; 1 without repeats.
        n_repeated: conditions with more than one set.
        remarks: of the reader.
        unit, source: of `rmse`, and where its floor comes from; the same for all counts.
    """

    unit: ClassVar[str] = "1"
    source: ClassVar[str] = "binomial"
    conditions: tuple[ConditionResult, ...]
    log_likelihood: float
    deviance: float
    log_likelihood_own: float
    rmse: float
    bias: float
    noise_floor: float
    overdispersion: float
    p_overdispersion: float
    n_repeated: int
    remarks: tuple[str, ...]

    @property
    def ratio_to_floor(self) -> float:
        """Return the error in units of the error expected from chance alone."""
        return self.rmse / self.noise_floor

    @property
    def n_samples(self) -> int:
        """Return the number of trials measured in all conditions."""
        return sum(one.measured[1] for one in self.conditions)

    @property
    def n_effective(self) -> float:
        """Return the effective number of trials: smaller where sets scatter more than binomially."""
        return self.n_samples / self.scatter

    @property
    def scatter(self) -> float:
        """Return the overdispersion if it exceeds chance, else 1."""
        return max(1.0, self.overdispersion) if self.p_overdispersion < LEVEL else 1.0

    @property
    def disagreeing(self) -> tuple[ConditionResult, ...]:
        """Return the conditions that disagree beyond chance, the worst first."""
        return tuple(sorted((c for c in self.conditions if c.disagrees), key=lambda c: -c.deviance))

    @property
    def contradictory(self) -> tuple[ConditionResult, ...]:
        """Return the conditions whose repeats contradict each other."""
        return tuple(c for c in self.conditions if c.contradictory)


def compare_counts(counts: Counts, simulated: Sequence[Count]) -> CountComparison:
    """Compare measured with simulated counts, condition by condition in the same order."""
    measured = [(c.successes, c.trials) for c in counts.conditions]
    pairs = list(zip(measured, simulated, strict=True))
    p = [fisher_p(a, b) for a, b in pairs]
    sets = [[(one.successes, one.trials) for one in c.sets] for c in counts.conditions]
    p_sets = [repeats_agree(one) for one in sets]
    repeated = [k for k, one in enumerate(sets) if len(one) > 1]
    p_sets_adjusted = dict(zip(repeated, holm([p_sets[k] for k in repeated]), strict=True))
    deviances = [deviance(a, b) for a, b in pairs]
    total = sum(deviances)
    # conditions that repeat and did not end alike; χ² over its degrees of freedom is 1 for binomial scatter
    told = [s for s in sets if len(s) > 1 and 0 < sum(k for k, _ in s) < sum(n for _, n in s)]
    freedom, scatter = sum(len(one) - 1 for one in told), sum(chi_square(one) for one in told)
    results = tuple(
        ConditionResult(
            condition=counts.conditions[k],
            simulated=b,
            log_likelihood=log_predictive(a, b),
            deviance=deviances[k],
            log_bayes_factor=log_bayes_factor(a, b),
            p=p[k],
            p_adjusted=p_adjusted,
            z=signed_z(a, b),
            p_repeats=p_sets[k],
            p_repeats_adjusted=p_sets_adjusted.get(k, 1.0),
            share_of_error=deviances[k] / total if total > 0 else 0.0,
        )
        for k, ((a, b), p_adjusted) in enumerate(zip(pairs, holm(p), strict=True))
    )
    errors = np.array([one.error for one in results])
    shares = [(s + t + 1) / (n + m + 2) for (s, n), (t, m) in pairs]  # of one probability for both
    noise = [q * (1 - q) * (1 / n + 1 / m) for q, ((_, n), (_, m)) in zip(shares, pairs, strict=True)]
    return CountComparison(
        conditions=results,
        log_likelihood=sum(one.log_likelihood for one in results),
        deviance=total,
        log_likelihood_own=sum(log_own(a) for a in measured),
        rmse=float(np.sqrt(np.mean(errors**2))),
        bias=float(np.mean(errors)),
        noise_floor=float(np.sqrt(np.mean(noise))),
        overdispersion=scatter / freedom if freedom else float("nan"),
        p_overdispersion=float(scipy.special.chdtrc(freedom, scatter)) if freedom else 1.0,
        n_repeated=len(repeated),
        remarks=counts.remarks,
    )
