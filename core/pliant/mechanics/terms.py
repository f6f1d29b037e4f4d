"""Law terms of a chain in plain Python: values, slopes and memory, joint by joint and axis by axis."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate, pairwise

import numpy as np

from pliant.records.design import Array
from pliant.records.history import REFERENCE_TEMPERATURE_C
from pliant.records.term import LawTerm, term_parameters

# Half-width of the central difference for slopes, in rad or m.
STEP = 1e-6


@dataclass(frozen=True, eq=False)
class TermMemory:
    """Memory of law terms.

    Attributes:
        previous: (n, a) joint coordinates at the end of the previous step.
        states: (n, a, states) their memory there.
        dt_s: duration of the next step; infinite if the next state is reached slowly.
        temperature_c: during that step.
    """

    previous: Array
    states: Array
    dt_s: float = math.inf
    temperature_c: float = REFERENCE_TEMPERATURE_C

    @staticmethod
    def at_rest(terms: Sequence[LawTerm], shape: tuple[int, int]) -> TermMemory:
        """Return the memory of a virgin chain with n joints of a axes."""
        return TermMemory(np.zeros(shape), np.zeros((*shape, sum(term.n_states for term in terms))))

    def over(self, dt_s: float) -> TermMemory:
        """Return the same memory before a step of another duration."""
        return replace(self, dt_s=dt_s)


@dataclass(frozen=True, eq=False)
class Contribution:
    """Combined values of all terms, each (n, a); `LawTerm` defines how they enter the effort."""

    moment: Array
    elastic: Array
    actuation: Array
    rest: Array


def _spans(counts: Iterable[int]) -> list[slice]:
    """Return consecutive slices of the given lengths."""
    return [slice(*span) for span in pairwise(accumulate(counts, initial=0))]


class LawTerms:
    """The terms of one chain with n joints of a axes."""

    def __init__(self, terms: Sequence[LawTerm], shape: tuple[int, int]) -> None:
        self.terms = tuple(terms)
        self.shape = shape
        self._spans = _spans(term.n_parameters for term in self.terms)
        self._numbers = term_parameters(self.terms, shape[0])
        self._states = _spans(term.n_states for term in self.terms)

    def rested(self) -> TermMemory:
        """Return the memory of a virgin chain at rest."""
        return TermMemory.at_rest(self.terms, self.shape)

    def contribution(self, q: Array, actuation: float | Array, memory: TermMemory) -> Contribution:
        """Return the values at coordinates q (n, a) under a net actuation, common to all joints or (n,)."""
        return self._evaluate(q, actuation, memory)[0]

    def slopes(self, q: Array, actuation: float | Array, memory: TermMemory) -> Contribution:
        """Return their derivatives by each joint's own coordinate, by central differences."""
        up = self.contribution(q + STEP, actuation, memory)
        down = self.contribution(q - STEP, actuation, memory)
        return Contribution(
            *((getattr(up, name) - getattr(down, name)) / (2 * STEP) for name in Contribution.__annotations__)
        )

    def advance(self, q: Array, actuation: float | Array, memory: TermMemory) -> TermMemory:
        """Return the memory after a step that ends at q (n, a)."""
        return replace(memory, previous=q.copy(), states=self._evaluate(q, actuation, memory)[1])

    def _evaluate(self, q: Array, actuation: float | Array, memory: TermMemory) -> tuple[Contribution, Array]:
        pushed = np.broadcast_to(actuation, self.shape[0]).tolist()
        values = Contribution(
            np.zeros(self.shape), np.ones(self.shape), np.ones(self.shape), np.zeros(self.shape)
        )
        states = memory.states.copy()
        dt, temperature = memory.dt_s, memory.temperature_c
        for place in np.ndindex(self.shape):
            angle = float(q[place])
            rate = (angle - float(memory.previous[place])) / dt if 0.0 < dt < math.inf else 0.0
            numbers = [self._numbers[place[0], span] for span in self._spans]
            for term, parameters, span in zip(self.terms, numbers, self._states, strict=True):
                old, new = memory.states[place][span], states[place][span]
                value = term.function(angle, rate, dt, pushed[place[0]], temperature, old, new, parameters)
                if term.role == "moment":
                    values.moment[place] += value
                elif term.role == "rest":
                    values.rest[place] += value
                elif term.role == "elastic":
                    values.elastic[place] *= value
                else:
                    values.actuation[place] *= value
        return values, states
