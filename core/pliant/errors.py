"""Errors that Pliant shows to people: one or two sentences, no traceback, a documented exit code.

Those that a table may raise, and the base of all, are defined in `pliant_tables.errors`, which imports nothing of core.
"""

from __future__ import annotations

import sys
from typing import NoReturn

from pliant_tables.errors import MissingDependencyError, PliantError, UserError, brief, closest

__all__ = [
    "INTERRUPTED",
    "ContractError",
    "ImpossibleEffectError",
    "InvalidDesignError",
    "MissingDependencyError",
    "NotReachedError",
    "PliantError",
    "PluginFailureError",
    "UserError",
    "brief",
    "closest",
    "interrupted",
    "interrupted_at_start",
]

INTERRUPTED = 130  # exit code after Ctrl-C


def interrupted(error: BaseException | None) -> bool:
    """Return whether Ctrl-C caused an error: compiled code turns a KeyboardInterrupt into a SystemError."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error is not None


def interrupted_at_start() -> NoReturn:
    """End the command after Ctrl-C during the import of its modules."""
    print("interrupted before anything began.", file=sys.stderr)
    sys.exit(INTERRUPTED)


class InvalidDesignError(UserError):
    """Error of a design that breaks a geometric inequality of its family; the message says which and by how much."""


class ImpossibleEffectError(UserError):
    """Error of an effect that a chain cannot have: `reason` says why, the message also what to do in a study."""

    def __init__(self, reason: str, advice: str = "take it out of 'effects'") -> None:
        super().__init__(reason, advice)
        self.reason = f"{reason}."

    def __str__(self) -> str:
        return "{}; {}.".format(*self.args)


class NotReachedError(PliantError):
    """Error of work that ran but did not reach its goal (not converged, infeasible)."""

    exit_code = 3


class ContractError(PliantError):
    """Error of a plugin that breaks its interface's contract; the message names the plugin and the clause."""


class PluginFailureError(ContractError, UserError):
    """Error in the code of a plugin that is not shipped; the message names the plugin, the method, the cause and the
    line.

    `raised` is the exception of a call into it, if that is the failure.
    """

    raised: Exception | None = None
