"""Check before a search that its space contains candidates that may be simulated."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from pliant.errors import MissingDependencyError, UserError
from pliant.pipeline.segments import chain_length_m
from pliant.pipeline.workbench import RunContext
from pliant.records.design import Array
from pliant_search.optimizer import Value, Variable
from pliant_search.problem.search_problem import NO_NUMBER, SearchProblem

SAMPLES = 4096
BUILT = 64  # samples whose study is built, so that the families validate their designs
SEEN = 4  # variables of the sample of least violation that the message shows


@dataclass(frozen=True)
class Feasibility:
    """Statistics of a sample of the space.

    Attributes:
        share: of the samples that break no constraint and are possible designs.
        samples: number of samples.
        broken: constraint → share of the samples that break it.
        refused: cause → number of the `built` designs that the study's models or families refused.
        built: number of designs that were built, all of which satisfy the constraints.
    """

    share: float
    samples: int
    broken: Mapping[str, float]
    refused: Mapping[str, int]
    built: int

    def note(self) -> str:
        """Return a note if less than 1 % of the space is feasible, else ""."""
        if self.share >= 0.01:
            return ""
        text = max(self.broken, key=self.broken.__getitem__, default="")
        worst = (
            f"'{text}' turns {100 * self.broken[text]:.3g} % away"
            if text
            else "the rest are no possible designs"
        )
        return f"about {100 * self.share:.2g} % of the search's space passes its constraints; {worst}."


def require_feasible(problem: SearchProblem, seed: int) -> Feasibility:
    """Sample the space evenly over the branches, and check that some samples are feasible.

    Args:
        problem: the search.
        seed: of the samples.

    Raises:
        UserError: no sample passes; with each constraint's share, or the families' reasons.
    """
    samples = _samples(problem, seed)
    count = len(next(iter(samples.values())))
    known: dict[str, Any] = {**problem.names.constants, **samples}
    amounts = {
        c.text: np.nan_to_num(np.broadcast_to(c.amount(known), count), nan=NO_NUMBER, posinf=NO_NUMBER)
        for c in problem.constraints
        if not c.uses("metric")
    }
    passed = np.all([amount == 0 for amount in amounts.values()], axis=0) if amounts else np.ones(count, bool)
    if not passed.any():
        raise UserError(_infeasible(problem, samples, amounts))
    rows = np.flatnonzero(passed)
    rows = rows[:: max(1, len(rows) // BUILT)][:BUILT]
    causes: Counter[str] = Counter()
    for turn, row in enumerate(rows):  # cycling through the conditions
        try:
            problem.apply(
                {name: column[row] for name, column in samples.items()}, turn % len(problem.conditions)
            )
        except MissingDependencyError:
            raise
        except UserError as error:
            causes[str(error).splitlines()[0]] += 1
    if causes.total() == len(rows):
        cause, most = causes.most_common(1)[0]
        raise UserError(
            f"no candidate of the search is a possible design: all of {len(rows)} samples that pass its constraints "
            f"are refused, {most} of them so: {cause}"
        )
    share = float(passed.mean()) * (1 - causes.total() / len(rows))
    broken = {text: float((amount > 0).mean()) for text, amount in amounts.items() if (amount > 0).any()}
    return Feasibility(share, count, broken, dict(causes.most_common()), len(rows))


def _samples(problem: SearchProblem, seed: int) -> dict[str, Array]:
    """Return variable → its values in all samples, a Sobol sequence that cycles through the branches."""
    axes = [one.variable for one in problem.variables if not one.each]
    branches = problem.branches()
    count = max(SAMPLES, len(branches))
    points = np.zeros((count, 0))
    if axes:
        whole = 1 << (count - 1).bit_length()  # a Sobol sequence is balanced in powers of two
        points = scipy.stats.qmc.Sobol(len(axes), seed=seed).random(whole)[:count]
    found = {axis.name: _scaled(axis, points[:, column]) for column, axis in enumerate(axes)}
    order = np.random.default_rng(seed).permutation(count) % len(branches)
    for name in branches[0]:
        found[name] = np.array([branch[name] for branch in branches], dtype=object)[order]
    return found


def _scaled(axis: Variable, shares: Array) -> Array:
    if axis.type == "categorical":
        index = np.minimum((shares * len(axis.choices)).astype(int), len(axis.choices) - 1)
        chosen: Array = np.array(axis.choices, dtype=object)[index]
        return chosen
    if axis.type == "integer":
        return np.minimum(axis.low + np.floor(shares * (axis.high - axis.low + 1)), axis.high)
    return axis.low + shares * (axis.high - axis.low)


def _infeasible(problem: SearchProblem, samples: Mapping[str, Array], amounts: Mapping[str, Array]) -> str:
    """Return lines on the constraints that no sample passes, and the sample of least violation, by their variables."""
    broken = {text: amount > 0 for text, amount in amounts.items()}
    total = sum(mask.astype(int) for mask in broken.values())
    lines = []
    for text, mask in broken.items():
        if mask.all():
            lines.append(f"'{text}' never holds")
        elif mask.any():
            alone = int((mask & (total == 1)).sum())
            lines.append(
                f"'{text}' fails in {100 * mask.mean():.3g} %, alone in {100 * alone / len(mask):.3g} %"
            )
    least = int(np.argmin(sum(amounts.values())))
    named = {
        name
        for c in problem.constraints
        if c.text in broken and broken[c.text][least]
        for name in c.variables
    }
    shown = []
    for one in problem.variables:
        if one.name in named:
            value = samples[one.name][least]
            written = value if isinstance(value, str) else f"{float(value):.4g}"
            shown.append(f"{one.name} = {written}{' ' + one.unit if one.unit else ''}")
    more = ", …" if len(shown) > SEEN else ""
    return (
        f"no candidate passes the search's constraints: of {len(samples[next(iter(samples))])} samples of its space, "
        f"{'; '.join(lines)}. Least broken: {', '.join(shown[:SEEN])}{more}. Widen the ranges or relax a constraint."
    )


def require_reachable(problem: SearchProblem, context: RunContext) -> None:
    """Check with the task of every condition that the longest straight chain reaches it.

    More and longer modules make longer chains, so the longest chain has every number at its upper bound;
    constraints are ignored. If no design at these bounds can be built, no check is made.

    Raises:
        UserError: the task is out of reach, with the message of its `check_reach`.
    """
    if problem.study.chain is None or problem.study.task is None:
        return
    for condition in range(len(problem.conditions)):
        longest, task = 0.0, problem.study.task
        for values in _largest(problem):
            try:
                study = problem.apply(values, condition)
                longest = max(longest, chain_length_m(context, study))
            except UserError:
                return
            assert study.task is not None
            task = study.task
        context.build("task", task).check_reach(longest)


def _largest(problem: SearchProblem) -> Iterator[Mapping[str, Value]]:
    """Yield the upper bounds of the numbers with each choice of each categorical variable in turn."""
    axes = [v.variable for v in problem.variables]
    base: dict[str, Value] = {axis.name: axis.choices[0] if axis.choices else axis.high for axis in axes}
    yield base
    for axis in axes:
        for choice in axis.choices[1:]:
            yield {**base, axis.name: choice}
