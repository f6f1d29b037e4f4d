"""The law terms of a chain as arrays that compiled loops read."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np

from pliant.errors import UserError
from pliant.records.term import LawTerm, TermFunction, numbers_of
from pliant_plugins.physics.compiled.functions import compile_function
from pliant_plugins.physics.compiled.motion import TERM_SIGNATURE

# The roles of law terms, as the compiled loops number them.
ROLES = ("moment", "elastic", "actuation", "rest")


def compiled_terms(terms: Sequence[LawTerm], n_joints: int) -> Any:
    """Addresses (m,), rows (m, 5) and numbers (n, P) of law terms; None where one cannot be compiled."""
    try:
        addresses = [int(_compiled(term.function).address) for term in terms]
    except UserError:  # it runs in plain Python then
        return None
    ends = np.cumsum([0, *(term.n_parameters for term in terms)])
    states = np.cumsum([0, *(term.n_states for term in terms)])
    rows = [[ROLES.index(term.role), *ends[k : k + 2], *states[k : k + 2]] for k, term in enumerate(terms)]
    return (
        np.array(addresses, np.int64),
        np.array(rows, np.int64).reshape(-1, 5),
        numbers_of(terms, n_joints),
    )


@cache
def _compiled(function: TermFunction) -> Any:
    return compile_function(function, TERM_SIGNATURE, "law term")
