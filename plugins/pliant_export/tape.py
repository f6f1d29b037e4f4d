"""A function as a list of steps of plain arithmetic: the form of a joint law for any language."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from pliant.records.design import Array

NUMBER, INPUT, TAKE, SELECT = "number", "input", "take", "?"
COMPARISONS: dict[str, Callable[[Any, Any], Any]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
    "==": operator.eq,
    "!=": operator.ne,
}
ARITHMETIC: dict[str, Callable[[Any, Any], Any]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
}
# Functions of one argument, by their names in Python's `math`, in C and in numpy.
FUNCTIONS = ("tanh", "exp", "log", "sqrt", "sin", "cos", "trunc", "abs")
# Functions of whole arrays; `take` needs the tape's table and is implemented in `run`.
NUMPY: dict[str, Callable[..., Any]] = {
    **ARITHMETIC,
    **COMPARISONS,
    **{name: getattr(np, name) for name in FUNCTIONS},
    "min": np.minimum,
    "max": np.maximum,
    "and": np.logical_and,
    "or": np.logical_or,
    "not": np.logical_not,
    SELECT: np.where,
}


class TapeStep(NamedTuple):
    """One step: the operation `name` applied to the results of the earlier steps `arguments`.

    `number` is the value of a constant ("number"), or the index of an input ("input").
    """

    name: str
    arguments: tuple[int, ...] = ()
    number: float = 0.0


@dataclass(frozen=True, eq=False)
class Tape:
    """Steps in order; names of inputs; for each named output the steps of its components.

    Attributes:
        table: (t,) numbers that "take" looks up by a rounded index.
    """

    inputs: tuple[str, ...]
    steps: tuple[TapeStep, ...]
    outputs: Mapping[str, tuple[int, ...]]
    table: Array

    @property
    def roots(self) -> tuple[int, ...]:
        """The steps of all outputs in a row."""
        return tuple(k for places in self.outputs.values() for k in places)

    def run(self, *inputs: Array) -> dict[str, list[Any]]:
        """Return the values of the outputs at inputs (n,) each."""
        values = self.values(*inputs)
        shape = np.broadcast_shapes(*(np.shape(one) for one in inputs))
        return {
            name: [np.broadcast_to(values[k], shape) for k in places] for name, places in self.outputs.items()
        }

    def values(self, *inputs: Any) -> list[Any]:
        """Return the value of every step."""
        found: list[Any] = []
        with np.errstate(all="ignore"):  # of branches that are not taken
            for step in self.steps:
                if step.name == NUMBER:
                    found.append(step.number)
                elif step.name == INPUT:
                    found.append(np.asarray(inputs[int(step.number)], float))
                elif step.name == TAKE:
                    place = np.asarray(found[step.arguments[0]]).astype(np.int64)
                    found.append(self.table[np.clip(place, 0, len(self.table) - 1)])
                else:
                    found.append(NUMPY[step.name](*(found[k] for k in step.arguments)))
        return found

    def needed(self) -> Tape:
        """Return the tape without steps that no output needs, and without an unused table."""
        wanted = set(self.roots)
        for k in range(len(self.steps) - 1, -1, -1):
            if k in wanted:
                wanted |= set(self.steps[k].arguments)
        place = {old: new for new, old in enumerate(sorted(wanted))}
        steps = tuple(
            self.steps[old]._replace(arguments=tuple(place[k] for k in self.steps[old].arguments))
            for old in sorted(wanted)
        )
        outputs = {name: tuple(place[k] for k in ks) for name, ks in self.outputs.items()}
        table = self.table if any(step.name == TAKE for step in steps) else np.zeros(0)
        return replace(self, steps=steps, outputs=outputs, table=table)

    def usual(self, *inputs: float) -> Tape:
        """Return the tape of the branches that these inputs take, without selections.

        Its output "unusual" is true where other inputs would take another branch; the values are then wrong.
        """
        values = self.values(*inputs)
        build = Builder(self.inputs, self.table)
        place: list[int] = []
        unusual: int | None = None
        for step in self.steps:
            arguments = tuple(place[k] for k in step.arguments)
            if step.name == SELECT:
                taken = bool(values[step.arguments[0]])
                other = build.op("not", arguments[0]) if taken else arguments[0]
                unusual = other if unusual is None else build.op("or", unusual, other)
                place.append(arguments[1] if taken else arguments[2])
            elif step.name == NUMBER:
                place.append(build.number(step.number))
            elif step.name == INPUT:
                place.append(build.input(int(step.number)))
            else:
                place.append(build.op(step.name, *arguments))
        outputs = {name: tuple(place[k] for k in ks) for name, ks in self.outputs.items()}
        never = build.op("<", build.number(1.0), build.number(0.0)) if unusual is None else unusual
        return build.tape({**outputs, "unusual": (never,)}).needed()


class Builder:
    """A builder of tapes: adds each step once and evaluates arithmetic of constants."""

    def __init__(self, inputs: Sequence[str], table: Array) -> None:
        self.inputs, self.table = tuple(inputs), np.asarray(table, float)
        self._steps: list[TapeStep] = []
        self._known: dict[TapeStep, int] = {}

    def number(self, value: float) -> int:
        """Return the step of a constant."""
        return self._add(TapeStep(NUMBER, (), float(value)))

    def input(self, place: int) -> int:
        """Return the step of an input."""
        return self._add(TapeStep(INPUT, (), float(place)))

    def constant(self, k: int) -> float | None:
        """Return the value of a step that is a constant, else None."""
        step = self._steps[k]
        return step.number if step.name == NUMBER else None

    def op(self, name: str, *arguments: int) -> int:
        """Return the step of an operation; a simpler one where constants allow it."""
        known = [self.constant(k) for k in arguments]
        if name == SELECT and known[0] is not None:
            return arguments[1] if known[0] else arguments[2]
        if name == SELECT and arguments[1] == arguments[2]:
            return arguments[1]
        if name != TAKE and all(value is not None for value in known):
            return self.number(float(NUMPY[name](*known)))
        if name == TAKE and known[0] is not None:
            return self.number(float(self.table[int(known[0])]))
        of_choice = self._distribute_over_choice(name, arguments, known)
        if of_choice is not None:
            return of_choice
        simpler = self._neutral(name, arguments, known)
        return self._add(TapeStep(name, arguments)) if simpler is None else simpler

    def tape(self, outputs: Mapping[str, Sequence[int]]) -> Tape:
        """Return the tape of the steps so far, with these outputs."""
        return Tape(
            self.inputs, tuple(self._steps), {name: tuple(ks) for name, ks in outputs.items()}, self.table
        )

    def _distribute_over_choice(
        self, name: str, arguments: tuple[int, ...], known: Sequence[float | None]
    ) -> int | None:
        """Rewrite an operation on a choice between two constants as a choice between two results, else None."""
        open_ones = [place for place, value in enumerate(known) if value is None]
        if name not in (TAKE, *ARITHMETIC) or len(open_ones) != 1:
            return None
        chosen = self._steps[arguments[open_ones[0]]]
        if chosen.name != SELECT or None in (
            self.constant(chosen.arguments[1]),
            self.constant(chosen.arguments[2]),
        ):
            return None
        results = []
        for way in chosen.arguments[1:]:
            own = list(arguments)
            own[open_ones[0]] = way
            results.append(self.op(name, *own))
        return self.op(SELECT, chosen.arguments[0], *results)

    def _neutral(self, name: str, arguments: tuple[int, ...], known: Sequence[float | None]) -> int | None:
        """Simplify adding zero and multiplying by one or by zero, for finite numbers; None where nothing simplifies."""
        if name == "*" and 0.0 in known:
            return self.number(0.0)
        if name in "+*" and known[0] == (0.0 if name == "+" else 1.0):
            return arguments[1]
        if name in "+-*/" and known[-1] == (0.0 if name in "+-" else 1.0):
            return arguments[0]
        if name == "/" and known[0] == 0.0:
            return self.number(0.0)
        if name == "or" and 0.0 in known:
            return arguments[1 - known.index(0.0)]
        return None

    def _add(self, step: TapeStep) -> int:
        # −0.0 == 0.0: they may share a step; a NaN would never be found again
        if step.name == NUMBER and not math.isfinite(step.number):
            raise ValueError(f"a constant is {step.number}")
        if step not in self._known:
            self._known[step] = len(self._steps)
            self._steps.append(step)
        return self._known[step]
