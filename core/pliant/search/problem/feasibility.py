"""Whether a search's space holds any candidate that may be simulated, before it begins."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from pliant.errors import MissingDependencyError, UserError
from pliant.interfaces.optimizer import Value, Variable
from pliant.pipeline.study import chain_length_m
from pliant.pipeline.workbench import Workbench
from pliant.records.design import Array
from pliant.search.problem.search_problem import NO_NUMBER, SearchProblem

SAMPLES = 4096
BUILT = 64  # samples whose study is built, so that the families judge their designs
SEEN = 4  # variables that the message shows of the least broken sample


@dataclass(frozen=True)
class Feasibility:
    """What a sample of the space says.

    Attributes:
        share: of the samples that break no constraint and are possible designs.
        samples: how many were drawn.
        broken: constraint → share of the samples that break it.
        refused: cause → how many of the `built` designs the study's models or families refused.
        built: designs that were built, all of which break no constraint.
    """

    share: float
    samples: int
    broken: Mapping[str, float]
    refused: Mapping[str, int]
    built: int

    def note(self) -> str:
        """What to say of a space of which little can be used; empty where all is well."""
        if self.share >= 0.01:
            return ""
        return (
            f"about {100 * self.share:.2g} % of the search's space passes its constraints; {self._worst()}."
        )

    def _worst(self) -> str:
        if not self.broken:
            return "the rest are no possible designs"
        text = max(self.broken, key=lambda name: self.broken[name])
        return f"'{text}' turns {100 * self.broken[text]:.3g} % away"


def require_feasible(problem: SearchProblem, seed: int) -> Feasibility:
    """Sample the space, spread evenly over the branches.

    Args:
        problem: what is searched.
        seed: of the samples.

    Raises:
        UserError: nothing passes; with each constraint's share, or the families' reasons.
    """
    samples = _samples(problem, seed)
    count = len(next(iter(samples.values())))
    amounts = _amounts(problem, samples, count)
    passed = np.all([amount == 0 for amount in amounts.values()], axis=0) if amounts else np.ones(count, bool)
    if not passed.any():
        raise UserError(_infeasible(problem, samples, amounts))
    refused, built = _refused(problem, samples, np.flatnonzero(passed))
    if sum(refused.values()) == built:
        raise UserError(_impossible(refused, built))
    share = float(passed.mean()) * (1 - sum(refused.values()) / built)
    broken = {text: float((amount > 0).mean()) for text, amount in amounts.items()}
    return Feasibility(share, count, {t: b for t, b in broken.items() if b > 0}, refused, built)


def _samples(problem: SearchProblem, seed: int) -> dict[str, Array]:
    """Variable → its values in all samples; a Sobol sequence, and the branches in turn."""
    axes = [one.variable for one in problem.variables if not one.each]
    branches = problem.branches()
    count = max(SAMPLES, len(branches))
    points = np.zeros((count, 0))
    if axes:
        whole = 1 << (count - 1).bit_length()  # a Sobol sequence is even in powers of two
        points = scipy.stats.qmc.Sobol(len(axes), seed=seed).random(whole)[:count]
    found = {axis.name: _scaled(axis, points[:, column]) for column, axis in enumerate(axes)}
    order = np.random.default_rng(seed).permutation(count) % len(branches)
    for name in branches[0]:
        column = np.array([branch[name] for branch in branches], dtype=object)
        found[name] = column[order]
    return found


def _scaled(axis: Variable, shares: Array) -> Array:
    if axis.type == "categorical":
        index = np.minimum((shares * len(axis.choices)).astype(int), len(axis.choices) - 1)
        chosen: Array = np.array(axis.choices, dtype=object)[index]
        return chosen
    if axis.type == "integer":
        whole: Array = axis.low + np.floor(shares * (axis.high - axis.low + 1))
        return np.minimum(whole, axis.high)
    return axis.low + shares * (axis.high - axis.low)


def _amounts(problem: SearchProblem, samples: Mapping[str, Array], count: int) -> dict[str, Array]:
    """Constraint of variables → (count,) by how much it is broken."""
    known: dict[str, Any] = problem.names.resolved(samples)
    return {
        constraint.text: np.nan_to_num(
            np.broadcast_to(constraint.amount(known), count), nan=NO_NUMBER, posinf=NO_NUMBER
        )
        for constraint in problem.constraints
        if not constraint.uses("metric")
    }


def _infeasible(problem: SearchProblem, samples: Mapping[str, Array], amounts: Mapping[str, Array]) -> str:
    """Which constraints nothing passes, and the sample that comes closest."""
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
    return (
        f"no candidate passes the search's constraints: of {len(samples[next(iter(samples))])} samples of its space, "
        f"{'; '.join(lines)}. Least broken: {_sample(problem, samples, least, amounts)}. "
        "Widen the ranges or relax a constraint."
    )


def _sample(
    problem: SearchProblem, samples: Mapping[str, Array], row: int, amounts: Mapping[str, Array]
) -> str:
    """The values of the variables that the broken constraints name."""
    named = {
        symbol.name
        for constraint in problem.constraints
        if constraint.text in amounts and amounts[constraint.text][row] > 0
        for symbol in constraint.names
        if symbol.role == "variable"
    }
    shown = [
        f"{one.name} = {_written(samples[one.name][row])}{' ' + one.unit if one.unit else ''}"
        for one in problem.variables
        if one.name in named
    ]
    more = ", …" if len(shown) > SEEN else ""
    return ", ".join(shown[:SEEN]) + more


def _written(value: Any) -> str:
    return value if isinstance(value, str) else f"{float(value):.4g}"


def _refused(problem: SearchProblem, samples: Mapping[str, Array], rows: Any) -> tuple[dict[str, int], int]:
    """Causes for which designs are refused, in the conditions in turn; and how many were built."""
    chosen = rows[:: max(1, len(rows) // BUILT)][:BUILT]
    causes: Counter[str] = Counter()
    for turn, row in enumerate(chosen):
        values: dict[str, Value] = {name: column[row] for name, column in samples.items()}
        try:
            problem.apply(values, turn % len(problem.conditions))
        except MissingDependencyError:
            raise
        except UserError as error:
            causes[str(error).splitlines()[0]] += 1
    return dict(causes.most_common()), len(chosen)


def _impossible(refused: Mapping[str, int], built: int) -> str:
    cause, count = next(iter(refused.items()))
    return (
        f"no candidate of the search is a possible design: all of {built} samples that pass its constraints are "
        f"refused, {count} of them so: {cause}"
    )


def require_reachable(problem: SearchProblem, bench: Workbench) -> None:
    """Ask the task of every condition whether the longest straight chain will do.

    More and longer modules make longer chains, so that the longest has every number at its upper bound, whatever the
    constraints. Where no design at these bounds can be built, nothing is known and nothing refused.

    Raises:
        UserError: the task is out of reach, as its `check_reach` says.
    """
    if problem.study.chain is None or problem.study.task is None:
        return
    for condition in range(len(problem.conditions)):
        longest, task = 0.0, problem.study.task
        for values in _largest(problem):
            try:
                study = problem.apply(values, condition)
                longest = max(longest, chain_length_m(bench, study))
            except UserError:
                return
            assert study.task is not None
            task = study.task
        bench.build("task", task).check_reach(longest)


def _largest(problem: SearchProblem) -> Iterator[Mapping[str, Value]]:
    """Upper bounds of the numbers, with each choice of each categorical variable in turn."""
    chosen = [v for v in problem.variables if v.variable.type == "categorical"]
    base: dict[str, Value] = {
        v.name: v.variable.choices[0] if v in chosen else v.variable.high for v in problem.variables
    }
    yield base
    for v in chosen:
        for choice in v.variable.choices[1:]:
            yield {**base, v.name: choice}
