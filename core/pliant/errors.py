"""Errors that Pliant shows to people: one or two sentences, no traceback, a documented exit code."""

from __future__ import annotations

import difflib
import sys
from collections.abc import Iterable
from typing import Any, NoReturn

from pliant.user_text import brief

INTERRUPTED = 130  # exit code after Ctrl-C


def interrupted(error: BaseException | None) -> bool:
    """Whether Ctrl-C is behind it: compiled code turns a KeyboardInterrupt into a SystemError."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error is not None


def interrupted_at_start() -> NoReturn:
    """End the command: Ctrl-C came while its modules were still being imported."""
    print("interrupted before anything began.", file=sys.stderr)
    sys.exit(INTERRUPTED)


class PliantError(Exception):
    """Base of all errors that Pliant raises on purpose; `exit_code` is what the command line returns.

    A message repeats what its user wrote, cut short: nobody finds the sentence in a megabyte.
    """

    exit_code = 2

    def __init__(self, *parts: Any) -> None:
        super().__init__(*(brief(part) if isinstance(part, str) else part for part in parts))


class UserError(PliantError):
    """The input is wrong. The message says what, where, what is allowed, and what to do."""


class MissingDependencyError(UserError):
    """A plugin needs a package that is not installed; the message names the command that installs it."""


class InvalidDesignError(UserError):
    """A design breaks one of its family's geometric inequalities; the message says which and by how much."""


class ImpossibleEffectError(UserError):
    """An effect that a chain cannot have: `reason` says why, the message also what to do where a study has it."""

    def __init__(self, reason: str, advice: str = "take it out of 'effects'") -> None:
        super().__init__(reason, advice)
        self.reason = f"{reason}."

    def __str__(self) -> str:
        return "{}; {}.".format(*self.args)


class NotReachedError(PliantError):
    """The work ran but did not reach what was asked (not converged, infeasible)."""

    exit_code = 3


class ContractError(PliantError):
    """A plugin breaks its interface's contract; the message names the plugin and the clause."""


def closest(word: str, known: Iterable[str]) -> str:
    """End a sentence about an unknown word: "; did you mean 'x'?" for the closest known word, else "."."""
    match = difflib.get_close_matches(word, list(known), n=1, cutoff=0.55)
    return f"; did you mean '{match[0]}'?" if match else "."
