"""Held-out recordings: drawn from their names alone, before any curve was plotted.

The draw was committed before the files were plotted or a model of them was run (see the history of this file).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

SEED = 20261124


def held_out(groups: Sequence[Sequence[str]], each: Sequence[int]) -> tuple[str, ...]:
    """Draw `each` names of each group from the sorted names; the draw depends on names and `SEED` alone."""
    rng = np.random.default_rng(SEED)
    drawn = [
        rng.choice(sorted(group), number, replace=False) for group, number in zip(groups, each, strict=True)
    ]
    return tuple(str(name) for names in drawn for name in sorted(names))
