"""Display of texts that users wrote: without control codes. `pliant_tables.errors.brief` truncates them."""

from __future__ import annotations

import re

# C0 and C1 without tab and line break, marks that reverse the direction of writing, halves of characters.
_CONTROLS = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\ud800-\udfff]")


def escape_controls(text: str) -> str:
    """Return the text with "�" for characters that a terminal or a browser would execute instead of showing."""
    return _CONTROLS.sub("�", text) if _CONTROLS.search(text) else text
