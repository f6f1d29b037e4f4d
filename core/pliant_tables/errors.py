"""Errors of wrong input: one or two sentences that say what, where, what is allowed and what to do.

They are defined here because this is the lowest package: `pliant.errors` adds those that need more of Pliant.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable
from typing import Any

LONGEST_WORD, LONGEST_LINE, MOST_LINES, LONGEST_MESSAGE = 400, 2000, 60, 10_000
_LONG_WORD = re.compile(rf"\S{{{LONGEST_WORD},}}")


def brief(text: str) -> str:
    """Return the text with words, lines and their number truncated: a long word to its first 60 characters and "…"."""
    if len(text) <= LONGEST_WORD:
        return text
    lines = _LONG_WORD.sub(lambda match: f"{match[0][:60]}…", text).split("\n")
    lines = [line if len(line) <= LONGEST_LINE else f"{line[: LONGEST_LINE - 200]}…" for line in lines]
    text = "\n".join(lines if len(lines) <= MOST_LINES else [*lines[:MOST_LINES], "…"])
    return text if len(text) < LONGEST_MESSAGE else f"{text[: LONGEST_MESSAGE - 2]}…"


class PliantError(Exception):
    """Base of all errors that Pliant raises on purpose; `exit_code` is what the command line returns.

    A message repeats the user's text truncated, so that the sentence stays readable.
    """

    exit_code = 2

    def __init__(self, *parts: Any) -> None:
        super().__init__(*(brief(part) if isinstance(part, str) else part for part in parts))


class UserError(PliantError):
    """Error of wrong input. The message says what, where, what is allowed, and what to do."""


class MissingDependencyError(UserError):
    """Error of a plugin that needs a package that is not installed; the message names the command that installs it."""


def closest(word: str, known: Iterable[str]) -> str:
    """Return the end of a sentence about an unknown word: "; did you mean 'x'?" with the closest word, else "."."""
    match = difflib.get_close_matches(word, list(known), n=1, cutoff=0.55)
    return f"; did you mean '{match[0]}'?" if match else "."
