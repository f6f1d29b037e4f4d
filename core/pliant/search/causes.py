"""Why candidates were refused or failed, and how often; causes that differ in their numbers only are one."""

from __future__ import annotations

import re
from collections.abc import Iterable

NUMBERS = re.compile(r"(?<![\w.])[-+\u2212]?\d+(?:[.,]\d+)*(?:[eE][-+]?\d+)?")  # not the 1 of n1
ALIKE = ", or the like"


def counted(causes: Iterable[str]) -> dict[str, int]:
    """Cause → how often, the most frequent first; of causes that differ in numbers the first, `ALIKE` behind it.

    "joint 1 stands 35 % outside" and "joint 4 stands 2 % outside" are one cause.
    """
    texts: dict[str, str] = {}
    counts: dict[str, int] = {}
    differ: set[str] = set()
    for cause in causes:
        words = NUMBERS.sub("#", cause)
        if texts.setdefault(words, cause) != cause:
            differ.add(words)
        counts[words] = counts.get(words, 0) + 1
    order = sorted(counts, key=lambda words: -counts[words])
    return {(texts[w].rstrip(".") + ALIKE if w in differ else texts[w]): counts[w] for w in order}
