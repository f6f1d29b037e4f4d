"""Chains and histories as the arrays that the compiled loop reads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.history import History
from pliant.records.term import LawTerm, TermFunction, numbers_of
from pliant_plugins.physics.compiled.functions import compile_function
from pliant_plugins.physics.compiled.terms import ROLES
from pliant_plugins.physics.quasistatic.joint_effort import TERM_SIGNATURE
from pliant_plugins.physics.stepping import check_driven


@dataclass(frozen=True, eq=False)
class Drive:
    """What changes from sample to sample, of all runs one after another: N samples, m actuators."""

    pressure: Array
    force: Array
    moment: Array
    payload: Array
    temperature: Array
    angles: Array

    @staticmethod
    def of(chain: ChainModel, histories: Sequence[History]) -> Drive:
        """Raises `UserError` where a history lacks an input of the chain, or a number of it."""
        join = np.concatenate
        if any(a.input not in h.actuation for a in chain.actuators for h in histories):
            check_driven(chain, histories)
        drive = Drive(
            pressure=np.stack(
                [join([h.actuation[a.input] for h in histories]) for a in chain.actuators], axis=1
            ),
            force=join([h.tip_force_n for h in histories]),
            moment=join([h.moment_n_m for h in histories]),
            payload=join(
                [
                    np.full(len(h), chain.payload_kg) if h.payload_kg is None else h.payload_kg
                    for h in histories
                ]
            ),
            temperature=join([h.temperature_c for h in histories]),
            angles=join([h.base_angles_rad for h in histories]),
        )
        if not all(np.all(np.isfinite(values)) for values in vars(drive).values()):
            check_driven(chain, histories)
        return drive


@dataclass(frozen=True, eq=False)
class Clock:
    """Time and order: duration of the step to each sample, whether a run starts there, whose specimen it is."""

    duration: Array
    start: Any
    specimen: Any
    n_specimens: int
    substeps: Any

    @staticmethod
    def of(chain: ChainModel, histories: Sequence[History], longest_step_s: float) -> Clock:
        """Steps longer than `longest_step_s` are cut into equal parts.

        Raises:
            UserError: a time that is not a number.
        """
        names = list(dict.fromkeys(h.specimen for h in histories))
        lengths = [len(h) for h in histories]
        first = np.cumsum([0, *lengths[:-1]])
        timed = [h.time_s is not None for h in histories]
        time = np.concatenate([np.zeros(len(h)) if h.time_s is None else h.time_s for h in histories])
        if not np.all(np.isfinite(time)):
            check_driven(chain, histories)
        duration = np.diff(time, prepend=time[:1])
        duration[first] = 0.0
        duration[~np.repeat(timed, lengths)] = np.inf
        start = np.zeros(len(duration), np.bool_)
        start[first] = True
        specimen = np.repeat([names.index(h.specimen) for h in histories], lengths)
        finite = np.where(np.isfinite(duration), duration, 0.0)
        substeps = np.maximum(1, np.ceil(finite / longest_step_s - 1e-9)).astype(np.int64)
        return Clock(duration, start, specimen, len(names), substeps)


@dataclass(frozen=True, eq=False)
class Terms:
    """Law terms as addresses of machine code and rows (role, first number, numbers, first state, states).

    `parameters` (n, P) holds the numbers of each joint.
    """

    addresses: Any
    rows: Any
    keeps: Any
    parameters: Array

    @staticmethod
    def of(terms: Sequence[LawTerm], n_joints: int, compiled: dict[TermFunction, Any]) -> Terms:
        """`compiled` remembers functions from call to call.

        Raises:
            UserError: a term that cannot be compiled.
        """
        rows: list[list[int]] = []
        keeps: list[bool] = []
        count = 0
        for term in terms:
            if term.function not in compiled:
                compiled[term.function] = compile_function(term.function, TERM_SIGNATURE, "law term")
            first, state = count, len(keeps)
            count += term.n_parameters
            keeps += [term.keeps] * term.n_states
            rows.append([ROLES.index(term.role), first, count - first, state, len(keeps) - state])
        addresses = [compiled[term.function].address for term in terms]
        return Terms(
            np.array(addresses, np.int64),
            np.array(rows, np.int64).reshape(-1, 5),
            np.array(keeps, np.bool_),
            numbers_of(terms, n_joints),
        )
