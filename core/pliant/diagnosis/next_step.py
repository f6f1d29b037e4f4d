"""Which effects to add next: those that a verdict names, or those that predict better whatever their name."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Literal

from pliant.diagnosis.diagnosis import Diagnosis
from pliant.diagnosis.evidence_table import THRESHOLDS, Kinds, sorted_kinds
from pliant.diagnosis.shared_effects import SharedEffect, shapes_at_bound, shared_effects
from pliant.diagnosis.unseen import best_of, best_prediction
from pliant.registry.discovery import Registry

# Effects that would predict as well are named up to so many.
MOST_ALIKE = 4
# How a step came about: see `StepProposal`.
Cause = Literal["", "named", "class", "open", "learned"]


@dataclass(frozen=True, eq=False)
class StepProposal:
    """What to add next.

    Attributes:
        found: the diagnosis that it rests on.
        order: kinds, the one first that explains most.
        stands_for: look-alikes of which it is one, itself included; empty where the verdict is the effect itself.
        cause: `named` by a verdict, by a `class` of look-alikes, or `open`: it predicts better, whatever it is.
        shared: what the credible explanations agree on, where none is believed by itself.
    """

    found: Diagnosis
    order: tuple[str, ...]
    stands_for: Kinds
    cause: Cause
    shared: SharedEffect | None = None

    @property
    def forms(self) -> Kinds:
        """Those of the kinds whose forms vary in the diagnosis."""
        fits = self.found.fits
        whole = fits.get(sorted_kinds(self.order))
        looked = [whole] if whole is not None else [fits[(kind,)] for kind in self.order if (kind,) in fits]
        return tuple(kind for kind in self.order if any(kind in fit.candidate.forms for fit in looked))

    def why(self, kind: str, registry: Registry) -> str:
        """Why this one of its kinds, in sentences."""
        if self.shared is not None:
            return _standing_in(self.shared, self.found)
        component = registry.get("effect", kind)
        notes = component.implementation_class().notes
        if self.cause == "open":
            others = [other for other in self.stands_for if other != kind][:MOST_ALIKE]
            same = f"; {' or '.join(others)} would predict as well here" if others else ""
            return (
                f"Taken because it predicts better ({component.summary}), not because these data name it as the cause"
                f"{same}."
            )
        known = f"The training runs speak for {kind}: {component.summary}."
        known += f" It is known by this: {notes.signature}" if notes.signature else ""
        return known + (f" On the bench: {notes.on_the_bench}" if notes.on_the_bench else "")


def named_step(found: Diagnosis) -> StepProposal | None:
    """What the verdict names, or a group of look-alikes one of which is missing."""
    shared = _shared(found)
    if found.verdict != "missing_effect" and shared is None:
        return None
    order = _by_gain(found, found.selected) if shared is None else (shared.chosen,)
    group = shared.stands_for if shared is not None and len(shared.stands_for) > 1 else ()
    return StepProposal(found, order, group, "class" if group else "named", shared)


def predicting_step(found: Diagnosis, without: Collection[str]) -> StepProposal | None:
    """What predicts readings better that no fit has seen, whatever its name; nothing that is there (`without`)."""
    if found.verdict == "nothing_missing":
        return None
    best = best_prediction(found, without)
    if best is None:
        return None
    return StepProposal(found, _by_gain(found, best.kinds), best.alike if len(best.alike) > 1 else (), "open")


def _shared(found: Diagnosis) -> SharedEffect | None:
    """What the credible explanations agree on, where none of them is believed by itself."""
    if found.verdict != "ambiguous":
        return None
    alike = {frozenset((pair.a, pair.b)) for pair in found.indistinguishable}
    alike |= {frozenset(pair) for pair in combinations(found.judgement.selected_class, 2)}
    bounds = shapes_at_bound(found.fits)
    shared = shared_effects(found.judgement.probability, alike, bounds, THRESHOLDS)
    if shared is None or len(shared.stands_for) == 1:
        return shared
    free = [kind for kind in shared.stands_for if kind not in bounds.get((kind,), frozenset())]
    return replace(shared, chosen=best_of(found, free, shared.chosen))


def _standing_in(shared: SharedEffect, found: Diagnosis) -> str:
    """That an effect is taken although the verdict is open, and which run would settle it."""
    if len(shared.stands_for) == 1:
        return (
            f"The explanations that are left differ in what else is missing; {shared.chosen} is in nearly all of them "
            f"({shared.probability:.0%})."
        )
    told = f"{shared.chosen} stands for one of {', '.join(shared.stands_for)}: these data cannot tell which"
    group = set(shared.stands_for)
    splits = [one for one in found.classes if one.run and len(group.intersection(one.kinds)) > 1]
    if splits:
        best = max(splits, key=lambda one: len(group.intersection(one.kinds)))
        return f"{told}; the run that would is: {best.words} ({best.minutes:g} min)."
    if found.next_run is not None:
        return f"{told}; the next run to do is: {found.next_run.run} ({found.next_run.minutes:g} min)."
    return f"{told}."


def _by_gain(found: Diagnosis, kinds: Sequence[str]) -> tuple[str, ...]:
    """These effects, the one first that explains most when it is added next."""
    chosen: list[str] = []
    while len(chosen) < len(kinds):
        left = [kind for kind in kinds if kind not in chosen]

        def square(kind: str) -> float:
            row = found.table.rows.get(sorted_kinds((*chosen, kind))) or found.table.rows[(kind,)]
            return row.mean_square

        chosen.append(min(left, key=square))
    return tuple(chosen)
