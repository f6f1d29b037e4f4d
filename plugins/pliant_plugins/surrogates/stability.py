"""Which of several laws a fit takes: the best on states left out, or a stable one that is about as good."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

# Stability may cost this factor and share of the effort's range; snap-through that is in the data costs more.
PRICE = (3.0, 2e-3)


def affordable(error: float) -> float:
    """The error, as a share of the effort's range, up to which a stable law is about as good as one of `error`."""
    return PRICE[0] * error + PRICE[1]


def stable_choice(errors: Sequence[float], slopes: Sequence[float]) -> int:
    """The place of the best stable law (largest ∂τ/∂u < 0) if one is about as good as the best, else of the best."""
    best = int(np.argmin(errors))
    limit = affordable(errors[best])
    stable = [k for k, slope in enumerate(slopes) if slope < 0 and errors[k] <= limit]
    return min(stable, key=lambda k: errors[k]) if stable else best
