"""What the credible explanations have in common when no single one is credible enough.

Effects are exchanged for each other where two credible hypotheses are alike but for them and the runs can hardly tell
them apart. If nearly all probability lies on hypotheses with some member of such a group, an effect of that kind is
missing although nobody knows which: one member may stand for the group in a model that is needed today.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass

from pliant.diagnosis.candidates import FitParameter
from pliant.diagnosis.evidence_table import (
    NOTHING,
    UNKNOWN,
    EvidenceThresholds,
    Kinds,
    credible_set,
)
from pliant.diagnosis.fitting import EffectFit


@dataclass(frozen=True)
class SharedEffect:
    """A group of effects of which one is missing.

    Attributes:
        chosen: the member to take.
        stands_for: all members, the most probable first; one where the hypotheses agree on an effect.
        probability: of all hypotheses with a member.
    """

    chosen: str
    stands_for: Kinds
    probability: float


def shared_effects(
    probability: Mapping[Kinds, float],
    alike: Collection[frozenset[str]],
    at_bound: Mapping[Kinds, frozenset[str]],
    thresholds: EvidenceThresholds,
) -> SharedEffect | None:
    """The group that is most probable; None where no group is believed, or one hypothesis is credible alone.

    Args:
        probability: of every hypothesis, the largest first.
        alike: pairs of kinds that these runs can hardly tell apart.
        at_bound: for hypotheses, the effects of which a shape ended on a bound. Such a member is chosen only where all
            others are, too.
        thresholds: `believed` is the least probability of a group; "nothing" and "outside the list" must hold less than
            the rest together.
    """
    doubt = probability.get(NOTHING, 0.0) + probability.get(UNKNOWN, 0.0)
    credible = [kinds for kinds in credible_set(probability) if kinds not in (NOTHING, UNKNOWN)]
    if len(credible) < 2 or doubt >= 1.0 - thresholds.believed:
        return None
    known = {kinds: p for kinds, p in probability.items() if kinds not in (NOTHING, UNKNOWN)}
    best: SharedEffect | None = None
    for group in _groups(credible, alike):
        total = sum(p for kinds, p in known.items() if not group.isdisjoint(kinds))
        if total < thresholds.believed or (best is not None and total <= best.probability):
            continue
        held = {kind: {kinds: p for kinds, p in known.items() if kind in kinds} for kind in group}
        members = sorted(group, key=lambda kind: (-sum(held[kind].values()), kind))
        leading = {kind: max(held[kind], key=held[kind].__getitem__) for kind in group}
        free = [kind for kind in members if kind not in at_bound.get(leading[kind], frozenset())]
        best = SharedEffect((free or members)[0], tuple(members), total)
    return best


def shapes_at_bound(fits: Mapping[Kinds, EffectFit]) -> dict[Kinds, frozenset[str]]:
    """For each fitted hypothesis the effects of which a parameter other than the strength ended on a bound.

    A bound at which the effect is merely a simpler one, such as a supply with one volume, is none.
    """
    found = {}
    for kinds, fit in fits.items():
        ends = zip(fit.candidate.parameters, fit.x, fit.at_limit, strict=True)
        found[kinds] = frozenset(
            one.kind for one, x, there in ends if there and not one.is_strength and not _simpler(one, x)
        )
    return found


def _simpler(parameter: FitParameter, x: float) -> bool:
    """Whether the parameter stands at a value at which its effect is declared to be a simpler one."""
    value = parameter.value(float(x))
    return any(math.isclose(value, at, rel_tol=1e-3) for at, _ in parameter.declared.simpler)


def _groups(credible: Collection[Kinds], alike: Collection[frozenset[str]]) -> list[frozenset[str]]:
    """Kinds joined by exchanges, directly or over others; each kind of a credible hypothesis is in one."""
    groups = [frozenset((kind,)) for kind in sorted({kind for kinds in credible for kind in kinds})]
    for pair in {frozenset(a) ^ frozenset(b) for a in credible for b in credible if len(a) == len(b)}:
        if len(pair) == 2 and pair in alike:
            joined = [group for group in groups if group & pair]
            groups = [group for group in groups if not group & pair] + [frozenset().union(*joined)]
    return groups
