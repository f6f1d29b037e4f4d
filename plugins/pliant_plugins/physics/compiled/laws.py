"""Scalar Python functions of plugins as compiled function pointers; laws and law terms of a chain as arrays of them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import accumulate, pairwise
from types import FunctionType
from typing import Any

import numpy as np
from numba import cfunc, types
from numba.extending import register_jitable

from pliant.errors import UserError
from pliant.mechanics.scalar_form import require_scalar_form
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.law import JointLaw
from pliant.records.term import LawTerm, term_parameters

_F, _A, _M = types.float64, types.float64[::1], types.float64[:, ::1]
# Of a law: actuation, u, parameters, and its outputs: τ, ∂τ/∂p, ∂τ/∂u.
LAW_SIGNATURE = types.void(_F, _A, _A, _A, _A, _M)
# The same of a law of several actuations: all of them, …, ∂τ_i/∂a_j in a row.
WIDE_SIGNATURE = types.void(_A, _A, _A, _A, _A, _M)
# Of a law term: u, rate, duration of the step, net input, temperature, old and new memory, parameters.
TERM_SIGNATURE = _F(_F, _F, _F, _F, _F, _A, _A, _A)
# The roles of law terms, as the compiled loops number them.
ROLES = ("moment", "elastic", "actuation", "rest")


@cache
def compile_function(function: Any, signature: Any, what: str) -> Any:
    """Compile a scalar function, with the functions of its file that it calls, to a `numba.cfunc`.

    It is cached on disk if the function is defined at module level.

    Raises:
        UserError: it cannot be compiled; `what` names it in the sentence ("law term").
    """
    try:
        for helper in _helpers(function):
            register_jitable(helper)
        # Functions made inside others have no stable name on disk.
        named = "<" not in function.__qualname__ and not function.__code__.co_filename.startswith("<")
        return cfunc(signature, cache=named, error_model="numpy")(function)
    except Exception as error:  # numba raises Python's errors as well as its own
        raise UserError(_why_not(function, error, what)) from error


def _helpers(function: FunctionType) -> list[FunctionType]:
    """Return the functions of its file that a function calls, directly or indirectly."""
    found: list[FunctionType] = []
    queue: list[Any] = [function]
    while queue:
        caller = queue.pop()
        for name in caller.__code__.co_names:
            helper = caller.__globals__.get(name)
            ours = isinstance(helper, FunctionType) and helper.__module__ == function.__module__
            if ours and helper is not function and helper not in found:
                found.append(helper)
                queue.append(helper)
    return found


def _why_not(function: Any, error: Exception, what: str) -> str:
    """Return a sentence on where and why a function cannot be compiled."""
    code = getattr(function, "__code__", None)
    if code is None:
        return f"the {what} {function!r} is no plain function; write one with 'def' at the top of its file"
    text = [line.strip() for line in str(error).splitlines() if line.strip()]
    reason = next((line for line in text if not line.startswith("Failed in")), type(error).__name__)
    lines = re.findall(r'File "[^"]*", line (\d+)', str(error)) or [code.co_firstlineno]
    return (
        f"{code.co_filename}, line {lines[0]}: the {what} '{function.__name__}' cannot be compiled "
        f"({reason.rstrip('.:')}); it is scalar Python: arithmetic, 'if' and functions of math."
    )


@dataclass(frozen=True, eq=False)
class CompiledTerms:
    """The law terms of a chain of n joints.

    Attributes:
        addresses: (m,) int64, machine code of each term; it lives as long as the process.
        rows: (m, 6) int64: role, first and last (exclusive) parameter, first and last (exclusive) state, whether the
            value depends on what was before.
        parameters: (n, P) of all terms, one term after another, by joint.
        keeps: (states,) whether a state outlasts the rest between runs.
    """

    addresses: Any
    rows: Any
    parameters: Array
    keeps: Any

    @staticmethod
    def from_terms(terms: Sequence[LawTerm], n_joints: int) -> CompiledTerms:
        """Compile terms once per process, cached on disk.

        Raises:
            UserError: a term that cannot be compiled.
        """
        addresses = [
            int(compile_function(term.function, TERM_SIGNATURE, "law term").address) for term in terms
        ]
        ends = np.cumsum([0, *(term.n_parameters for term in terms)])
        states = np.cumsum([0, *(term.n_states for term in terms)])
        rows = [
            [ROLES.index(t.role), *ends[k : k + 2], *states[k : k + 2], t.needs_time or t.n_states > 0]
            for k, t in enumerate(terms)
        ]
        return CompiledTerms(
            np.array(addresses, np.int64),
            np.array(rows, np.int64).reshape(-1, 6),
            term_parameters(terms, n_joints),
            np.array([term.keeps for term in terms for _ in range(term.n_states)], np.bool_),
        )

    @property
    def arrays(self) -> tuple[Any, Any, Array, int]:
        """Return the arguments of `combine`: addresses, rows, parameters (n·P,), P."""
        return self.addresses, self.rows, self.parameters.ravel(), self.parameters.shape[1]


def compiled_terms(terms: Sequence[LawTerm], n_joints: int) -> tuple[Any, Any, Array, int] | None:
    """Return the arguments of `combine` for a chain's terms; None if a term cannot be compiled."""
    try:
        return CompiledTerms.from_terms(terms, n_joints).arrays
    except UserError:  # it runs in plain Python then
        return None


@dataclass(frozen=True, eq=False)
class PackedLaws:
    """Arguments of the compiled loops for l laws of a axes, independent of the chain.

    Attributes:
        addresses, less: (l,) see `CompiledLaws`; spans: (l, 2); boxes: (l, m + a, 2).
        parameters: (P,) of all laws, one after another.
        counts: how many actuations each law takes at once.
    """

    addresses: Any
    spans: Any
    parameters: Array
    less: Array
    boxes: Array
    counts: tuple[int, ...]

    @staticmethod
    def from_laws(laws: Sequence[JointLaw]) -> PackedLaws | None:
        """Pack laws; return None if one of them has no scalar form.

        Raises:
            UserError: a scalar form that cannot be compiled.
            ContractError: a scalar form that differs from the law.
        """
        scalars = [law.scalar() for law in laws]
        known = [scalar for scalar in scalars if scalar is not None]
        if len(known) < len(scalars):
            return None
        ends = accumulate((len(scalar.parameters) for scalar in known), initial=0)
        counts = tuple(len(law.actuations) for law in laws)
        addresses = [law_address(s.function, count) for s, count in zip(known, counts, strict=True)]
        for law in laws:
            require_scalar_form(law)
        boxes = [law.domain.box for law in laws]
        if len(set(counts)) > 1:
            boxes = [
                box[[0] * (max(counts) - n) + [*range(len(box))]]
                for box, n in zip(boxes, counts, strict=True)
            ]
        return PackedLaws(
            np.array(addresses, np.int64),
            np.array(list(pairwise(ends)), np.int64).reshape(-1, 2),
            np.concatenate([np.zeros(0), *(np.asarray(scalar.parameters, float) for scalar in known)]),
            np.array([scalar.less_rest for scalar in known]),
            np.array(boxes, float),
            counts,
        )


@dataclass(frozen=True, eq=False)
class CompiledLaws:
    """Laws of n joints with a axes under k actuators.

    Attributes:
        addresses: (n,) int64, the compiled law function of each joint; they live as long as the process.
        spans: (n, 2) int64, first and last (exclusive) of each joint's parameters.
        parameters: (P,) of all laws, one after another; joints with the same law share them.
        signs: (k,) of the actuators: τ = Σ_k s_k [law(p_k, s_k q) − r law(0, s_k q)].
        drives: (n, 3) int64, first and last (exclusive) actuator of each joint, and how many its law takes at once.
        less: (n,) r, see `ScalarLaw`.
        boxes: (n, m + a, 2) the domain of each joint's law: actuations, then deformations, low and high; rows of
            actuations that a law does not have repeat its first.
    """

    addresses: Any
    spans: Any
    parameters: Array
    signs: Array
    drives: Any
    less: Array
    boxes: Array

    @staticmethod
    def from_chain(chain: ChainModel) -> CompiledLaws | None:
        """Pack the laws of a chain; None if one has no scalar form, or an actuator's T is no number.

        Raises:
            UserError: a scalar form that cannot be compiled.
        """
        return CompiledLaws.in_place(chain, PackedLaws.from_laws(chain.laws))

    @staticmethod
    def in_place(chain: ChainModel, packed: PackedLaws | None) -> CompiledLaws | None:
        """Return the chain's laws, packed before, at its joints; None as for `of`."""
        extends = chain.laws[0].joint == "extensible"
        turned = any(a.rotation_rad or (extends and a.sign != 1.0) for a in chain.actuators)
        if packed is None or turned:
            return None
        every, counts = (0, len(chain.actuators)), packed.counts
        of_joint = np.array([joint.law for joint in chain.joints])
        return CompiledLaws(
            packed.addresses[of_joint],
            packed.spans[of_joint],
            packed.parameters,
            np.array([actuator.sign for actuator in chain.actuators], float),
            np.array([(*(joint.drives or every), counts[joint.law]) for joint in chain.joints], np.int64),
            packed.less[of_joint],
            packed.boxes[of_joint],
        )

    @property
    def arrays(self) -> tuple[Any, Any, Array, Array, Any, Array]:
        """Return the arguments of `efforts`: addresses, spans, parameters, signs, drives, less."""
        return self.addresses, self.spans, self.parameters, self.signs, self.drives, self.less


@cache
def law_address(function: Any, actuations: int = 1) -> int:
    """Return the address of a law's compiled scalar function, compiled once per process and cached on disk.

    Args:
        function: of a `ScalarLaw`.
        actuations: how many the law has.

    Raises:
        UserError: it cannot be compiled.
    """
    signature = LAW_SIGNATURE if actuations == 1 else WIDE_SIGNATURE
    return int(compile_function(function, signature, "law").address)
