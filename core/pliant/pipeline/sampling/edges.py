"""How far the main axis's angles can be trusted: the box ends where convolutions touch or nothing converges."""

from __future__ import annotations

from pliant.pipeline.sampling.targets import Target
from pliant.pipeline.sampling.walk import Walk

# Actuation of each trial as a share of the limit: that border hardly depends on it, so each trial is
# also a state somewhere else.
ACTUATIONS = (0.0, 0.5, 0.25, 0.75)


def trusted_box(walk: Walk, axis: str, limit: float, low: float, high: float) -> tuple[float, float]:
    """The part of [low, high] that states show to be free of self-contact, and that contains the free branch."""
    free = [one.state for one in walk.solved if one.target.branch == "free"]
    sound = [state.angle_rad for state in free if state.trusted]
    inner_low, inner_high = min(0.0, *sound), max(s.angle_rad for s in free)
    return (
        _edge(walk, axis, limit, inner_low, low),
        _edge(walk, axis, limit, inner_high, high) if free[-1].trusted else high,
    )


def _edge(walk: Walk, axis: str, limit: float, inner: float, outer: float) -> float:
    """`outer` if a state there is sound, else the furthest sound one found by halving towards `inner`."""
    if inner == outer:
        return inner
    reached, trial = inner, outer
    for share in ACTUATIONS:
        found = walk.reach(Target("constrained", share * limit, {axis: trial}, explored=axis))
        if found is not None and found.trusted:
            reached = trial
            if trial == outer:
                break
        else:
            outer = trial
        trial = (reached + outer) / 2
    return reached
