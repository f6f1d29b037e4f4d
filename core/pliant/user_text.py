"""Texts that users wrote, where they are shown again: no control codes, and never a megabyte of them."""

from __future__ import annotations

import re

LONGEST_WORD, LONGEST_LINE, MOST_LINES, LONGEST_MESSAGE = 400, 2000, 60, 10_000
_LONG_WORD = re.compile(rf"\S{{{LONGEST_WORD},}}")
# C0 and C1 without tab and line break, marks that reverse the direction of writing, halves of characters.
_CONTROLS = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\ud800-\udfff]")


def brief(text: str) -> str:
    """The text with words, lines and their number cut short: of a long word its first 60 characters, then "…"."""
    if len(text) <= LONGEST_WORD:
        return text
    lines = _LONG_WORD.sub(lambda match: f"{match[0][:60]}…", text).split("\n")
    lines = [line if len(line) <= LONGEST_LINE else f"{line[: LONGEST_LINE - 200]}…" for line in lines]
    text = "\n".join(lines if len(lines) <= MOST_LINES else [*lines[:MOST_LINES], "…"])
    return text if len(text) < LONGEST_MESSAGE else f"{text[: LONGEST_MESSAGE - 2]}…"


def visible(text: str) -> str:
    """The text with "�" for what a terminal or a browser would obey instead of showing it."""
    return _CONTROLS.sub("�", text) if _CONTROLS.search(text) else text
