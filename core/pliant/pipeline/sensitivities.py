"""Defaults of a study that change its result by more than its error bar, by simulating each increased by a tenth."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic import ValidationError

from pliant.config.study import Study, written_name
from pliant.config.study_keys import KeyPath
from pliant.errors import PliantError
from pliant.execution.progress import ProgressBar
from pliant.interfaces.base import FrozenModel
from pliant.pipeline.checks import DefaultNotChecked, DefaultThatMatters
from pliant.records.rollout import TaskResult
from pliant.units import config_field_unit

# Blocks whose numbers affect a result; those of the second line through the law.
SIMULATED = ("physics", "task", "effects", "chain")
OF_THE_LAW = ("material", "family", "fem")
TENTH = 1.1
# Error bar of a metric if the study has no 'uncertainty': this share of it, or of the chain's length.
ERROR_BAR = 0.01
# Metrics that count states or describe the solution process.
NO_NUMBERS = ("unsettled_levels", "converged", "outside_domain")


@dataclass(frozen=True)
class Budget:
    """Time budget of sensitivities, in s.

    Attributes:
        total_s: for all of them.
        task_s: expected time of one simulation, until some were simulated.
        fem_s: expected time of the FEM of the study's designs; 0 if its laws need none.
        words: description of the budget, for the sentence about omitted defaults.
    """

    total_s: float
    task_s: float
    fem_s: float
    words: str


@dataclass(frozen=True)
class OwnResult:
    """The study's own result.

    Attributes:
        metrics: of its task.
        length_m: of its chain.
        spread: metric → half-width of its interval under the laws' error bars, if the study requests them.
    """

    metrics: Mapping[str, Any]
    length_m: float
    spread: Mapping[str, float]

    def scale(self, metric: str) -> float:
        """Return the scale of a change of the metric."""
        return self.length_m if metric.endswith("_m") else max(abs(self.metrics[metric]), 1e-9)

    def largest_change(self, after: Mapping[str, Any]) -> tuple[str, float, float]:
        """Return the metric that changed most relative to its error bar, its relative change, and the relative bar."""
        found = [("", 0.0, ERROR_BAR)]
        for name, value in self.metrics.items():
            other = after.get(name)
            if name in NO_NUMBERS or not (_is_finite(value) and _is_finite(other)):
                continue
            scale = self.scale(name)
            bar = max(self.spread.get(name, 0.0) / scale, ERROR_BAR)
            found.append((name, abs(other - value) / scale, bar))
        return max(found, key=lambda one: one[1] / one[2])


def sensitivities(
    study: Study, answer: OwnResult, simulate: Callable[[Study], TaskResult], budget: Budget, bar: ProgressBar
) -> tuple[list[DefaultThatMatters], list[DefaultNotChecked]]:
    """Return the defaults that matter, the strongest first, and those that were not checked.

    Args:
        study: with a task.
        answer: its result.
        simulate: the task's result of a variant.
        budget: of time; a default that is expected to exceed it is not checked.
        bar: of progress, a step for each default.
    """
    found, left = [], []
    begun, longest_s = time.perf_counter(), 0.0
    for path, value, name in default_numbers(study):
        bar.describe(name)
        bar.advance()
        started = time.perf_counter()
        expected = (longest_s or budget.task_s) + (budget.fem_s if path[0] in OF_THE_LAW else 0.0)
        if started - begun + expected > budget.total_s:
            left.append(DefaultNotChecked(name, budget.words, too_long=True))
            continue
        there, cause = _answer_near(study, path, value, simulate)
        longest_s = max(longest_s, time.perf_counter() - started) if path[0] in SIMULATED else longest_s
        if there is None:
            left += [DefaultNotChecked(name, cause)] if cause else []
            continue
        metric, change, error_bar = answer.largest_change(there.metrics)
        if change >= error_bar:
            unit, size = _unit(study, path), float(np.abs(np.asarray(value, float)).max())
            found.append(DefaultThatMatters(name, size, unit, metric, change, error_bar))
    return sorted(found, key=lambda one: -one.change / one.error_bar), left


def _answer_near(
    study: Study, path: KeyPath, value: Any, simulate: Callable[[Study], TaskResult]
) -> tuple[TaskResult | None, str]:
    """Return the task's result with a number increased by a tenth, else decreased, else None and the cause.

    The cause is "" if the study may state no other value, since the number belongs to something that it lacks.
    """
    cause = ""
    for factor in (TENTH, 1.0 / TENTH):
        try:
            return simulate(changed(study, path, _scaled(value, factor))), ""
        except ValidationError:
            continue
        except PliantError as error:
            cause = str(error)
    return None, cause


def default_numbers(study: Study) -> Iterator[tuple[KeyPath, Any, str]]:
    """Yield path, value and written key of every nonzero number that the study leaves at its default."""
    for head in (*SIMULATED, *OF_THE_LAW):
        block = getattr(study, head)
        for place, one in enumerate(block) if isinstance(block, tuple) else [(None, block)]:
            path: KeyPath = (head,) if place is None else (head, place)
            if isinstance(one, FrozenModel):
                yield from _block_numbers(one, path, ".".join(map(str, path)))


def _block_numbers(block: FrozenModel, path: KeyPath, words: str) -> Iterator[tuple[KeyPath, Any, str]]:
    for name in type(block).model_fields:
        value, written = getattr(block, name), f"{words}.{written_name(type(block), name)}"
        if isinstance(value, FrozenModel):
            yield from _block_numbers(value, (*path, name), written)
            continue
        numbers = value if isinstance(value, tuple) else (value,)
        real = bool(numbers) and all(isinstance(one, float) for one in numbers) and any(numbers)
        if real and name not in block.model_fields_set:
            yield (*path, name), value, written


def changed(node: Any, path: KeyPath, value: Any) -> Any:
    """Return the study, or a block of it, with another value at a path, validated block by block.

    Raises:
        ValidationError: a value that its block refuses.
    """
    if not path:
        return value
    head, rest = path[0], path[1:]
    if isinstance(node, tuple):
        assert isinstance(head, int)
        return (*node[:head], changed(node[head], rest, value), *node[head + 1 :])
    assert isinstance(head, str)
    if isinstance(node, Mapping):
        return {**node, head: changed(node[head], rest, value)}
    inner = changed(getattr(node, head), rest, value)
    if isinstance(node, Study):
        return node.model_copy(update={head: inner})
    stated = {name: getattr(node, name) for name in node.model_fields_set}
    return type(node).model_validate({**stated, head: inner})


def _unit(study: Study, path: KeyPath) -> str:
    block: Any = study
    for key in path[:-1]:
        block = block[key] if isinstance(key, int) else getattr(block, key)
    return config_field_unit(type(block), str(path[-1]))


def _scaled(value: Any, factor: float) -> Any:
    return tuple(factor * one for one in value) if isinstance(value, tuple) else factor * value


def _is_finite(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
