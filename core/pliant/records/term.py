"""Law term: a term that an effect adds to the law of every joint, with or without memory."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
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
    `math` or similar functions of the same file. It is called as

        value = function(angle, rate, dt_s, actuation, temperature_c, old, new, parameters)

    with `angle` in rad (m on a prismatic joint), `rate` = (angle − angle before) / dt_s, `dt_s` the time since
    the previous sample (infinite if a state is reached slowly: then `rate` is 0 and all relaxation is complete),
    `actuation` the sum of signed inputs in Pa or N, and writes into `new` its memory at the end of the step. It must
    not change `old`.

    Attributes:
        role: use of the value: `moment` is added to the effort (N·m), `elastic` and `actuation` are factors,
            `rest` shifts the unloaded angle (rad).
        function: see above.
        parameters: numbers that the function gets.
        per_joint: for effects that differ between joints, one row per joint of numbers that the function gets after
            `parameters`; empty if all joints are alike.
        per_payload_kg: one row per joint that is added to its row of `per_joint` for each kg by which the payload of a
            run exceeds the chain's; empty if the numbers do not depend on the payload.
        n_states: numbers of memory per joint and axis, all 0 in a rested virgin specimen.
        keeps: whether the memory is damage, which does not heal between runs.
        needs_time: whether the value depends on rate, time or memory, so that only engines with
            `Capabilities.internal_states` support it.
        is_inertia: whether the value represents masses that are accelerated. Engines with `Capabilities.dynamic`
            simulate these masses and refuse the term.
    """

    role: Role
    function: TermFunction
    parameters: tuple[float, ...]
    n_states: int = 0
    keeps: bool = False
    needs_time: bool = False
    per_joint: tuple[tuple[float, ...], ...] = ()
    is_inertia: bool = False
    per_payload_kg: tuple[tuple[float, ...], ...] = ()

    @property
    def n_parameters(self) -> int:
        """The number of parameters of the function."""
        return len(self.parameters) + (len(self.per_joint[0]) if self.per_joint else 0)

    def numbers(self, joint: int) -> tuple[float, ...]:
        """Return the parameters of the function for one joint."""
        return (*self.parameters, *self.per_joint[joint]) if self.per_joint else self.parameters

    def carrying(self, more_kg: float) -> LawTerm:
        """Return the term of a chain whose payload is larger by this mass."""
        if not self.per_payload_kg or more_kg == 0.0:
            return self
        pairs = zip(self.per_joint, self.per_payload_kg, strict=True)
        rows = tuple(tuple(a + more_kg * b for a, b in zip(row, more, strict=True)) for row, more in pairs)
        return replace(self, per_joint=rows)


def term_parameters(terms: Sequence[LawTerm], n_joints: int) -> Array:
    """Return (n_joints, P) numbers of all terms, one term after another.

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
