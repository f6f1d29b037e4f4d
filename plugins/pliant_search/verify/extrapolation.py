"""Whether a best design leans on laws where they know little: outside their data, or far from its own FEM."""

from __future__ import annotations

import math

from pliant.formatting import percent
from pliant_search.records import FoundDesign, Verification

# Metric of every task: number of joints outside the data of their law.
OUTSIDE = "outside_domain"


def leaning(best: FoundDesign, check: Verification, law_error: float | None) -> tuple[str, ...]:
    """Return the causes, as parts of a sentence; empty if the laws of the search hold at the best design.

    Args:
        best: the best design, as the search simulated it.
        check: of it.
        law_error: largest error of a law against FEM as a share of its range; None accepts any.
    """
    causes = []
    outside = best.metrics.get(OUTSIDE, 0.0)
    if math.isfinite(outside) and outside > 0:
        causes.append(f"{outside:.3g} joints stand outside the data of their law")
    for law in check.laws:
        worst = float(law.get("worst_of_range", math.nan))
        if law_error is not None and worst > law_error:
            name = f" of {law['name']}" if law.get("name") else ""
            causes.append(f"the law{name} misses FEM by {percent(worst)} of its range")
    return tuple(causes)
