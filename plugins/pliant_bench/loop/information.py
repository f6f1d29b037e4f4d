"""Information that a run gave: fall of the entropy of the explanations' probabilities between two diagnoses."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any


def entropy_nats(verdict: Mapping[str, Any]) -> float:
    """Return the entropy of the probabilities of a diagnosis, in nats."""
    shares = [float(one["probability"]) for one in verdict["hypotheses"]]
    return -sum(p * math.log(p) for p in shares if p > 0.0)


def obtained_nats(before: Mapping[str, Any] | None, after: Mapping[str, Any]) -> float | None:
    """Return the fall of the entropy; negative where a run made the explanations more uncertain; None at the first."""
    return None if before is None else entropy_nats(before) - entropy_nats(after)
