"""Steps of an improvement: what was added, and what to add next, by name or for a better prediction.

If no single explanation is credible enough, effects are interchangeable if two credible hypotheses differ only in them
and the runs can hardly distinguish them. If nearly all probability is on hypotheses with some member of such a group,
an effect of that kind is missing although it is unknown which: one member may represent the group in a model that is
needed today.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Literal

from pliant.diagnosis.bands import Bands
from pliant.diagnosis.candidates import FitParameter
from pliant.diagnosis.data_split import TrainTestSplit
from pliant.diagnosis.diagnosis import Diagnosis
from pliant.diagnosis.effect_fit import EffectFit
from pliant.diagnosis.evidence_table import (
    NOTHING,
    THRESHOLDS,
    UNKNOWN,
    EvidenceThresholds,
    Kinds,
    credible_set,
    sorted_kinds,
)
from pliant.diagnosis.extension import Extension
from pliant.diagnosis.learned_term import LearnedTerm
from pliant.diagnosis.next_run import NextRun
from pliant.diagnosis.readings import Score
from pliant.diagnosis.unseen import best_prediction, best_single_effect
from pliant.evidence.excess import Excess
from pliant.formatting import output_unit
from pliant.interfaces.effect import EffectConfig
from pliant.measurements.floors import Floor
from pliant.registry.discovery import Registry


@dataclass(frozen=True)
class SharedEffect:
    """A group of effects of which one is missing.

    Attributes:
        chosen: the member to take.
        stands_for: all members, the most probable first; one if the hypotheses agree on an effect.
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
    """Return the most probable group; None if no group is accepted, or one hypothesis alone is credible.

    Args:
        probability: of every hypothesis, the largest first.
        alike: pairs of kinds that these runs can hardly distinguish.
        at_bound: for hypotheses, the effects of which a shape ended on a bound. Such a member is chosen only if all
            others are, too.
        thresholds: `accepted` is the least probability of a group; "nothing" and "outside the list" must have less than
            the rest together.
    """
    doubt = probability.get(NOTHING, 0.0) + probability.get(UNKNOWN, 0.0)
    credible = [kinds for kinds in credible_set(probability) if kinds not in (NOTHING, UNKNOWN)]
    if len(credible) < 2 or doubt >= 1.0 - thresholds.accepted:
        return None
    known = {kinds: p for kinds, p in probability.items() if kinds not in (NOTHING, UNKNOWN)}
    best: SharedEffect | None = None
    for group in _groups(credible, alike):
        total = sum(p for kinds, p in known.items() if not group.isdisjoint(kinds))
        if total < thresholds.accepted or (best is not None and total <= best.probability):
            continue
        held = {kind: {kinds: p for kinds, p in known.items() if kind in kinds} for kind in group}
        members = sorted(group, key=lambda kind: (-sum(held[kind].values()), kind))
        leading = {kind: max(held[kind], key=held[kind].__getitem__) for kind in group}
        free = [kind for kind in members if kind not in at_bound.get(leading[kind], frozenset())]
        best = SharedEffect((free or members)[0], tuple(members), total)
    return best


def shapes_at_bound(fits: Mapping[Kinds, EffectFit]) -> dict[Kinds, frozenset[str]]:
    """Return for each fitted hypothesis the effects with a parameter, other than the strength, on a bound.

    A bound at which the effect only reduces to a simpler one, such as a supply with one volume, does not count.
    """
    found = {}
    for kinds, fit in fits.items():
        ends = zip(fit.candidate.parameters, fit.x, fit.at_limit, strict=True)
        found[kinds] = frozenset(
            one.kind for one, x, there in ends if there and not one.is_strength and not _simpler(one, x)
        )
    return found


def _simpler(parameter: FitParameter, x: float) -> bool:
    """Return whether the parameter has a value at which its effect is declared to be a simpler one."""
    value = parameter.value(float(x))
    return any(math.isclose(value, at, rel_tol=1e-3) for at, _ in parameter.declared.simpler)


def _groups(credible: Collection[Kinds], alike: Collection[frozenset[str]]) -> list[frozenset[str]]:
    """Return groups of kinds joined by exchanges, directly or not; each kind of a credible hypothesis is in one."""
    groups = [frozenset((kind,)) for kind in sorted({kind for kinds in credible for kind in kinds})]
    for pair in {frozenset(a) ^ frozenset(b) for a in credible for b in credible if len(a) == len(b)}:
        if len(pair) == 2 and pair in alike:
            joined = [group for group in groups if group & pair]
            groups = [group for group in groups if not group & pair] + [frozenset().union(*joined)]
    return groups


# Maximum number of named effects that would predict as well.
MOST_ALIKE = 4
# Origin of a step: see `StepProposal`.
Cause = Literal["", "named", "class", "open", "learned", "law"]


@dataclass(frozen=True, eq=False)
class StepProposal:
    """The next addition to the model.

    Attributes:
        found: the diagnosis on which it is based.
        order: kinds, the one that explains most first.
        stands_for: look-alikes that it represents, itself included; empty if the verdict is the effect itself.
        cause: `named` by a verdict, by a `class` of look-alikes, or `open`: it predicts better, whatever it is.
        shared: what the credible explanations agree on, if none is accepted alone.
    """

    found: Diagnosis
    order: tuple[str, ...]
    stands_for: Kinds
    cause: Cause
    shared: SharedEffect | None = None

    @property
    def forms(self) -> Kinds:
        """Return the kinds whose forms vary in the diagnosis."""
        fits = self.found.fits
        whole = fits.get(sorted_kinds(self.order))
        looked = [whole] if whole is not None else [fits[(kind,)] for kind in self.order if (kind,) in fits]
        return tuple(kind for kind in self.order if any(kind in fit.candidate.forms for fit in looked))

    def why(self, kind: str, registry: Registry) -> str:
        """Return why this one of its kinds is added, in sentences."""
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
        known = f"The training runs support {kind}: {component.summary}."
        known += f" It is known by this: {notes.signature}" if notes.signature else ""
        return known + (f" On the bench: {notes.inspection}" if notes.inspection else "")


@dataclass(frozen=True, eq=False)
class Step:
    """One model of the improvement.

    Attributes:
        added: the effects of this step; empty for the original model.
        effects: all effects of the model.
        why: the reason for this step, and where the model is still wrong after it, in sentences.
        locked: error on the test runs.
        locked_se: standard error of its ratio to the floor, from the floor's and from the number of runs.
        unseen: that of the test runs whose condition is in no training run; None without such.
        training: error on training runs, each left out of the fit that predicts it; blocks of a single run.
        stands_for: look-alikes that the added effect represents, itself included, if the data could not distinguish
            them; empty if the verdict was the effect itself.
        cause: `named` by a verdict, by a `class` of look-alikes, or `open`: it predicts better, whatever it is;
            `learned`: it describes the remaining error; `law`: it corrects the law; empty for the original model.
        learned: the learned term of this step; None for effects.
    """

    added: tuple[str, ...]
    effects: tuple[EffectConfig, ...]
    why: str
    locked: Score
    locked_se: float
    unseen: Score | None
    training: Score
    stands_for: Kinds = ()
    cause: Cause = ""
    learned: LearnedTerm | None = None

    @property
    def named(self) -> str:
        """Return what was added, with the look-alikes that it represents; empty for the original model."""
        if self.learned is not None:
            return "the law's own error" if self.cause == "law" else "a learned term"
        others = [kind for kind in self.stands_for if kind not in self.added]
        return " + ".join(self.added) + (f" (or {', '.join(others)})" if others else "")


@dataclass(frozen=True, eq=False)
class Improvement:
    """The result of an improvement.

    Attributes:
        steps: the original model, then one entry per effect.
        stop: the last verdict, or `no_gain`, `same_effect`, `most_steps`.
        reason: why it stopped, in sentences.
        locked: the division into training and test runs.
        floors: by output, of all runs.
        final: the last fit, with its uncertainty; None if no effect was added.
        remarks: limitations of the result, in sentences.
        next_run: the measurement proposed by the last diagnosis.
        bands: of the last model on all runs; None if no effect was added, or if a learned term follows them.
    """

    steps: tuple[Step, ...]
    stop: str
    reason: str
    locked: TrainTestSplit
    floors: Mapping[str, Floor]
    judged: bool
    final: Extension | None
    remarks: tuple[str, ...]
    next_run: NextRun | None = None
    bands: Bands | None = None

    @property
    def learned(self) -> LearnedTerm | None:
        """Return the learned term of the last step, if it is one."""
        return self.steps[-1].learned

    @property
    def scored_on(self) -> str:
        """Return which readings the errors of the steps refer to."""
        if self.locked.runs:
            return "runs held out"
        return "runs left out" if len(self.locked.training.runs) > 1 else "blocks left out"


def change_in_words(before: Score, after: Score, se: float = math.nan) -> str:
    """Return the change of an error in words.

    Over the noise if that is known (`se` of the second ratio): ``from 2.05 to 1.28 ± 0.10 times the noise``; by its
    first output otherwise: ``from 0.90° to 0.10° rms in bend angle``.
    """
    if math.isfinite(before.over_floor) and math.isfinite(after.over_floor):
        return f"from {before.over_floor:.2f} to {Excess(after.over_floor, se)} times the noise"
    name = next(iter(after.rmse), "")
    unit = output_unit(name)
    return f"from {unit.text(before.rmse[name], 3)} to {unit.text(after.rmse[name], 3)} rms in {unit.label}"


def named_step(diagnosis: Diagnosis) -> StepProposal | None:
    """Return the effects that the verdict names, or a group of look-alikes one of which is missing; else None."""
    shared = _shared(diagnosis)
    if diagnosis.verdict != "missing_effect" and shared is None:
        return None
    order = _by_gain(diagnosis, diagnosis.selected) if shared is None else (shared.chosen,)
    group = shared.stands_for if shared is not None and len(shared.stands_for) > 1 else ()
    return StepProposal(diagnosis, order, group, "class" if group else "named", shared)


def predicting_step(diagnosis: Diagnosis, without: Collection[str]) -> StepProposal | None:
    """Return the effects that best predict unseen readings, whatever their name, except `without`; else None."""
    if diagnosis.verdict in ("nothing_missing", "law_off"):
        return None
    best = best_prediction(diagnosis, without)
    if best is None:
        return None
    return StepProposal(
        diagnosis, _by_gain(diagnosis, best.kinds), best.alike if len(best.alike) > 1 else (), "open"
    )


def _shared(diagnosis: Diagnosis) -> SharedEffect | None:
    """Return what the credible explanations agree on, if none of them is accepted alone; else None."""
    if diagnosis.verdict != "ambiguous":
        return None
    alike = {frozenset((pair.a, pair.b)) for pair in diagnosis.indistinguishable}
    alike |= {frozenset(pair) for pair in combinations(diagnosis.judgement.selected_class, 2)}
    bounds = shapes_at_bound(diagnosis.fits)
    shared = shared_effects(diagnosis.judgement.probability, alike, bounds, THRESHOLDS)
    if shared is None or len(shared.stands_for) == 1:
        return shared
    free = [kind for kind in shared.stands_for if kind not in bounds.get((kind,), frozenset())]
    return replace(shared, chosen=best_single_effect(diagnosis, free, shared.chosen))


def _standing_in(shared: SharedEffect, diagnosis: Diagnosis) -> str:
    """Return why an effect is added although the verdict is open, and which run would settle it."""
    if len(shared.stands_for) == 1:
        return (
            f"The explanations that are left differ in what else is missing; {shared.chosen} is in nearly all of them "
            f"({shared.probability:.0%})."
        )
    known = (
        f"{shared.chosen} stands for one of {', '.join(shared.stands_for)}: these data do not determine which"
    )
    group = set(shared.stands_for)
    splits = [one for one in diagnosis.classes if one.run and len(group.intersection(one.kinds)) > 1]
    if splits:
        best = max(splits, key=lambda one: len(group.intersection(one.kinds)))
        return f"{known}; the run that would is: {best.words} ({best.minutes:g} min)."
    if diagnosis.next_run is not None:
        return (
            f"{known}; the next run to do is: {diagnosis.next_run.run} ({diagnosis.next_run.minutes:g} min)."
        )
    return f"{known}."


def _by_gain(diagnosis: Diagnosis, kinds: Sequence[str]) -> tuple[str, ...]:
    """Return these effects in the order of their gain when added next."""
    chosen: list[str] = []
    while len(chosen) < len(kinds):
        left = [kind for kind in kinds if kind not in chosen]

        def square(kind: str) -> float:
            row = diagnosis.table.rows.get(sorted_kinds((*chosen, kind))) or diagnosis.table.rows[(kind,)]
            return row.mean_square

        chosen.append(min(left, key=square))
    return tuple(chosen)
