"""Evidence of counts: every candidate's binomial likelihood at a few levels, and the resulting probabilities.

A hypothesis varies one number, or several at once, over a grid of levels of their plausible ranges; each level is
equally likely before the counts. Its evidence is the mean of its likelihoods over the grid, which penalizes every
level that does not fit, so that no further penalty for its parameters is needed (MacKay, *Information Theory,
Inference, and Learning Algorithms*, chapter 28). Trial k draws the same random numbers at every level (common random
numbers), so that levels differ by the varied number and not by chance.

"Nothing is missing" is the unchanged model; "outside the list" gives each condition a separate uniform probability.
The three kinds of explanation (nothing, something listed, something else) are equally probable before the counts, and
the listed ones share their third: the penalty for testing many (Scott and Berger, *Ann. Statist.* 38 (2010) 2587).
Hypotheses that change no simulated count are excluded. Evidences are divided by 2, as in every diagnosis, because no
simulation is exact. Repeats that scatter more than binomially divide them again.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from pliant.diagnosis.evidence_table import NOTHING, UNKNOWN, Kinds
from pliant.diagnosis.evidence_table import probabilities as verdict_probabilities
from pliant.execution.executors import Workers
from pliant.pipeline.workbench import RunContext
from pliant.records.design import Array
from pliant_counts.binomial import Count, log_own, log_predictive
from pliant_counts.comparison import CountComparison, compare_counts
from pliant_counts.counted_study import CountedStudy
from pliant_counts.parameters import VariedParameter
from pliant_counts.trials import Setting, simulate_trials

TEMPERATURE = 2.0
Point = tuple[tuple[VariedParameter, ...], tuple[float, ...]]  # the varied parameters, and their levels


@dataclass(frozen=True, eq=False)
class Explanation:
    """One hypothesis after the scan.

    Attributes:
        parameters: the varied parameters; empty for the unchanged model.
        grid: levels of the parameters, one tuple per point.
        simulated: counts of every point, by condition.
        log_likelihood: (points, conditions) of the measured counts.
    """

    parameters: tuple[VariedParameter, ...]
    grid: tuple[tuple[float, ...], ...]
    simulated: tuple[tuple[Count, ...], ...]
    log_likelihood: Array

    @property
    def kinds(self) -> Kinds:
        """Return its name in a table: the parameters' names."""
        return tuple(parameter.name for parameter in self.parameters)

    @property
    def total(self) -> Array:
        """Return (points,) log-likelihood of all conditions together."""
        return np.asarray(self.log_likelihood.sum(axis=1))

    @property
    def log_evidence(self) -> float:
        """Return the log of the mean likelihood over the grid."""
        return float(scipy.special.logsumexp(self.total) - np.log(len(self.total)))

    @property
    def best(self) -> int:
        """Return the index of the point of the largest likelihood."""
        return int(np.argmax(self.total))

    @property
    def weights(self) -> Array:
        """Return (points,) posterior probability of each point."""
        return np.asarray(np.exp(self.total - scipy.special.logsumexp(self.total)))

    @property
    def shares(self) -> Array:
        """Return (conditions,) probability of success, mean over the points by their weights."""
        s, m = np.moveaxis(np.array(self.simulated, float), 2, 0)
        return np.asarray(self.weights @ ((s + 1) / (m + 2)))

    @property
    def unseen(self) -> Array:
        """Return (conditions,) log probability of each condition's count when the others alone weight the points."""
        total = self.total[:, None]
        left = scipy.special.logsumexp(total, axis=0)
        return np.asarray(left - scipy.special.logsumexp(total - self.log_likelihood, axis=0))


@dataclass(frozen=True, eq=False)
class CountEvidence:
    """The table of evidences of counts.

    Attributes:
        comparison: of the unchanged model.
        rows: by the names of the varied parameters; NOTHING among them.
        comparisons: of every row at its best point.
        log_evidence: of every row that moves a count and of UNKNOWN, before tempering.
        probability: of the same, the largest first, with sum one.
    """

    comparison: CountComparison
    rows: Mapping[Kinds, Explanation]
    comparisons: Mapping[Kinds, CountComparison]
    log_evidence: Mapping[Kinds, float]
    probability: Mapping[Kinds, float]


def count_evidence(
    context: RunContext,
    counted: CountedStudy,
    hypotheses: Sequence[Sequence[VariedParameter]],
    workers: Workers = 1,
) -> CountEvidence:
    """Simulate every hypothesis at every level under all conditions, and weigh them.

    Args:
        context: plugins, store, progress; every setting is an artifact of the store, so that the scan can be resumed.
        counted: the study and the counts.
        hypotheses: parameters that are varied together; the unchanged model is always included.
        workers: see `executor_for`.
    """
    points: list[Point] = [((), ())]
    for moved in hypotheses:
        points += [(tuple(moved), levels) for levels in itertools.product(*(one.levels for one in moved))]
    conditions = counted.counts.conditions
    settings = []
    for parameters, levels in points:
        for condition in conditions:
            setting = Setting(counted.condition_task(condition), counted.study.effects)
            for parameter, level in zip(parameters, levels, strict=True):
                setting = parameter.moved(setting, condition, level)
            settings.append(setting)
    counts = simulate_trials(context, counted.study, settings, workers)
    by_point = [tuple(counts[i : i + len(conditions)]) for i in range(0, len(counts), len(conditions))]
    return weighed(counted, points, by_point)


def weighed(
    counted: CountedStudy,
    points: Sequence[Point],
    simulated: Sequence[tuple[Count, ...]],
) -> CountEvidence:
    """Return the table of simulated counts: `points` are (parameters, levels), without parameters for NOTHING."""
    measured = [(c.successes, c.trials) for c in counted.counts.conditions]
    rows: dict[Kinds, Explanation] = {}
    for parameters in dict.fromkeys(parameters for parameters, _ in points):
        of = [k for k, (moved, _) in enumerate(points) if moved == parameters]
        counts = tuple(simulated[k] for k in of)
        likelihood = [[log_predictive(a, b) for a, b in zip(measured, one, strict=True)] for one in counts]
        row = Explanation(parameters, tuple(points[k][1] for k in of), counts, np.array(likelihood))
        rows[row.kinds] = row
    comparisons = {
        kinds: compare_counts(counted.counts, row.simulated[row.best]) for kinds, row in rows.items()
    }
    still = set(rows[NOTHING].simulated)
    moving = {kinds: row for kinds, row in rows.items() if kinds == NOTHING or set(row.simulated) != still}
    evidence = {kinds: row.log_evidence for kinds, row in moving.items()}
    evidence[UNKNOWN] = sum(log_own(a) for a in measured)
    plain = comparisons[NOTHING]
    return CountEvidence(plain, rows, comparisons, evidence, probabilities(evidence, plain.scatter))


def probabilities(log_evidence: Mapping[Kinds, float], scatter: float = 1.0) -> dict[Kinds, float]:
    """Return posterior probabilities with a prior of a third each for nothing, unknown and the listed ones."""
    temperature = TEMPERATURE * scatter
    listed = max(1, sum(kinds not in (NOTHING, UNKNOWN) for kinds in log_evidence))
    price = temperature * float(np.log(listed))  # tempered like the evidence, it is the prior's share
    weighed = {k: v - (0.0 if k in (NOTHING, UNKNOWN) else price) for k, v in log_evidence.items()}
    return verdict_probabilities(weighed, temperature)
