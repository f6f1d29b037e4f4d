"""Checks of the block `experiment` when a study is read: units, ranges, conditions that a person can set."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from pliant.config.problems import at_place
from pliant.config.study import Study
from pliant.errors import UserError, closest
from pliant.registry.discovery import Registry
from pliant.units import UnitError
from pliant_bench.bench import ChannelLimits
from pliant_bench.config import ExperimentConfig
from pliant_bench.plans import CONDITIONS

Where = Callable[[Sequence[Any]], str]


def check_experiment(study: Study, registry: Registry, where: Where) -> None:
    """Raise `UserError`, with its line, for a wrong unit, an empty range, or a condition that no recording has."""
    settings: ExperimentConfig = study.need("experiment", "an experiment")
    for name, limits in settings.inputs.items():
        with _said_at(where, "inputs", name):
            _check_range(limits.limits(name))
    for name, envelope in settings.outputs.items():
        with _said_at(where, "outputs", name):
            _check_range(envelope.limits(name))
    for name in settings.manual:
        with _said_at(where, "manual", name):
            if name not in CONDITIONS:
                known = ", ".join(CONDITIONS)
                raise UnitError(
                    f"it is no condition of a recording{closest(name, CONDITIONS)} Allowed: {known}"
                )
            settings.levels(name)


def _check_range(limits: ChannelLimits) -> None:
    if not limits.low < limits.high:
        raise UnitError(
            f"'low' is {limits.low:g} and 'high' {limits.high:g} in SI; 'high' should be above 'low'"
        )
    if not (limits.rate > 0.0 and limits.acceleration > 0.0):
        raise UnitError("'rate' and 'acceleration' should be above 0")


@contextmanager
def _said_at(where: Where, block: str, name: str) -> Iterator[None]:
    """Turn the sentence of an error into one with the line and the key."""
    try:
        yield
    except UnitError as error:
        key = ("experiment", block, name)
        text = str(error)
        end = "" if text.endswith((".", "?")) else "."
        raise UserError(f"{at_place(where(key))}'{'.'.join(key)}': {text}{end}") from None
