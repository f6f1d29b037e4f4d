"""A law term: what an effect adds to the law of every joint, with or without memory."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pliant.errors import ContractError
from pliant.records.design import Array

# angle, rate, dt_s, actuation, temperature_c, old states, new states, parameters → number
TermFunction = Callable[[float, float, float, float, float, Array, Array, Array], float]
Role = Literal["moment", "elastic", "actuation", "rest"]


@dataclass(frozen=True, eq=False)
class LawTerm:
    """One scalar function of the joint's motion, evaluated joint by joint and axis by axis.

    With E(u) = τ(0, u) the elastic part of a law and A(p, u) = τ(p, u) − E(u) its actuation part, the effort
    with terms is

        τ' = Π f_elastic · E(u − Σ rest) + Π f_actuation · A(p, u) + Σ moment

    The function is plain scalar Python, so that an engine may compile it: arithmetic, `if`, and functions of
    `math` or of its own file that are themselves so. It is called as

        value = function(angle, rate, dt_s, actuation, temperature_c, old, new, parameters)

    with `angle` in rad (m on a prismatic joint), `rate` = (angle − angle before) / dt_s, `dt_s` the time since
    the sample before (infinite where a state is reached slowly: then `rate` is 0 and everything that relaxes
    has relaxed), `actuation` the sum of signed inputs in Pa or N, and writes into `new` what its memory becomes
    if the step ends here. It must not change `old`.

    Attributes:
        role: what the value is: `moment` is added to the effort (N·m), `elastic` and `actuation` are factors,
            `rest` moves the unloaded angle (rad).
        function: see above.
        parameters: numbers that the function gets.
        per_joint: for effects that act on each joint differently, one row per joint of numbers that its function
            gets behind `parameters`; empty where all joints are alike.
        n_states: numbers of memory per joint and axis, all 0 in a rested virgin specimen.
        keeps: the memory is damage: rest between runs does not heal it.
        needs_time: the value depends on rate, time or memory, so that only engines with
            `Capabilities.internal_states` can follow it.
        is_inertia: the value stands for masses that must be accelerated. Engines with `Capabilities.dynamic` move them
            by themselves and refuse the term.
    """

    role: Role
    function: TermFunction
    parameters: tuple[float, ...]
    n_states: int = 0
    keeps: bool = False
    needs_time: bool = False
    per_joint: tuple[tuple[float, ...], ...] = ()
    is_inertia: bool = False

    @property
    def n_parameters(self) -> int:
        """How many numbers the function gets."""
        return len(self.parameters) + (len(self.per_joint[0]) if self.per_joint else 0)

    def numbers(self, joint: int) -> tuple[float, ...]:
        """What the function of one joint gets."""
        return (*self.parameters, *self.per_joint[joint]) if self.per_joint else self.parameters


def numbers_of(terms: Sequence[LawTerm], n_joints: int) -> Array:
    """(n_joints, P) numbers of all terms, one term after another.

    Raises:
        ContractError: a term has numbers for another number of joints.
    """
    for term in terms:
        if term.per_joint and len(term.per_joint) != n_joints:
            raise ContractError(
                f"law term '{term.function.__name__}' has numbers for {len(term.per_joint)} joints; the chain has "
                f"{n_joints}"
            )
    rows = [[value for term in terms for value in term.numbers(joint)] for joint in range(n_joints)]
    return np.array(rows, float).reshape(n_joints, -1)
