"""What a next run has to tell apart: the explanations that are left, or the only one and what could still be missing.

Where one explanation has no rival, the next run should be the one most likely to contradict it: the explanation alone
competes with the explanation and one further effect of the list, each further effect at the parameters that the runs so
far leave possible: those of the second most probable explanation first, then those that the runs determine least.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from pliant.diagnosis.candidates import NINETY, EffectSet
from pliant.diagnosis.diagnosis import Diagnosis
from pliant.diagnosis.effect_fit import EffectFit
from pliant.diagnosis.evidence_table import NOTHING, UNKNOWN, Kinds, sorted_kinds
from pliant.diagnosis.next_run import MOST_CONTENDERS, Belief, information_matrix
from pliant.registry.discovery import Registry

# An explanation with less than this share of the largest probability is no rival.
RIVAL = 0.05
# A model predicts poorly if its error on runs left out is this many times the noise.
POOR = 2.0
# Probability of an explanation without a rival against all further effects together: even odds.
SETTLED = 0.5
# Groups of further effects, those that the runs so far determine least first.
MOST_GROUPS = 3
# Verdicts that name a cause, or that nothing is missing.
FINAL = ("missing_effect", "nothing_missing", "law_off", "unknown_effect")
Purpose = Literal["decide", "expose"]


@dataclass(frozen=True, eq=False)
class Question:
    """What a run has to tell apart.

    Attributes:
        purpose: decide between the explanations that are left, or expose what the only one lacks.
        beliefs: contenders with their probabilities; to expose, a group of further effects each, with assumed ones.
    """

    purpose: Purpose
    beliefs: tuple[Belief, ...]

    @property
    def contenders(self) -> tuple[Kinds, ...]:
        """Return all hypotheses, each once."""
        return tuple(dict.fromkeys(kinds for belief in self.beliefs for kinds in belief.contenders))


def question(diagnosis: Diagnosis, registry: Registry, met: Collection[str] = ()) -> Question:
    """Return what the next run has to tell apart; `met` are further effects that a run would have shown."""
    belief = Belief.from_fits(diagnosis.fits, diagnosis.judgement.probability, diagnosis.noise)
    shares = sorted((belief.probability[kinds] for kinds in belief.contenders), reverse=True)
    if diagnosis.verdict not in FINAL and len(shares) > 1 and shares[1] >= RIVAL * shares[0]:
        return Question("decide", (belief,))
    return exposing(diagnosis, registry, met)


def is_poor(diagnosis: Diagnosis) -> bool:
    """Return whether the model predicts too poorly for its expectations of other runs to be reliable."""
    if diagnosis.verdict in ("unknown_effect", "law_off"):
        return True
    ratio = diagnosis.left_out_ratio(diagnosis.explained)
    return math.isfinite(ratio) and ratio > POOR


def exposing(diagnosis: Diagnosis, registry: Registry, met: Collection[str] = ()) -> Question:
    """Return the question what the most probable explanation lacks: single effects except `met`, in groups."""
    belief = Belief.from_fits(diagnosis.fits, diagnosis.judgement.probability, diagnosis.noise)
    base, size = diagnosis.explained, MOST_CONTENDERS - 1
    second = next((kinds for kinds in belief.probability if kinds not in (base, UNKNOWN)), NOTHING)
    order = sorted(_least_determined(diagnosis, belief), key=lambda kinds: not set(kinds) & set(second))
    singles = [kinds for kinds in order if not set(kinds) & {*base, *met}]
    groups = [singles[k : k + size] for k in range(0, len(singles), size)]
    return Question(
        "expose", tuple(_against(diagnosis, belief, base, one, registry) for one in groups[:MOST_GROUPS])
    )


def _against(
    diagnosis: Diagnosis, belief: Belief, base: Kinds, group: list[Kinds], registry: Registry
) -> Belief:
    """Return the explanation at even odds with itself and one effect of the group."""
    fits = {base: diagnosis.fits[base]}
    fits |= {
        kinds if base == NOTHING else (*base, *kinds): _added(diagnosis, belief, base, kinds, registry)
        for kinds in group
    }
    odds = {kinds: SETTLED if kinds == base else (1.0 - SETTLED) / len(group) for kinds in fits}
    plain = {NOTHING: diagnosis.fits[NOTHING]}
    return Belief(plain | fits, odds, belief.n_effective, belief.square, belief.thresholds)


def _least_determined(diagnosis: Diagnosis, belief: Belief) -> list[Kinds]:
    """Return the single effects, those first whose strength the runs so far restrict least."""
    spread: dict[Kinds, float] = {}
    for kinds, fit in diagnosis.fits.items():
        if len(kinds) != 1 or not fit.candidate.parameters or not math.isfinite(fit.mean_square()):
            continue
        low, high = fit.candidate.parameters[0].plausible
        known = information_matrix(fit, belief.n_effective, belief.square)
        spread[kinds] = float(np.sqrt(np.linalg.inv(known)[0, 0])) * 2.0 * NINETY / (high - low)
    return sorted(spread, key=lambda kinds: -spread[kinds])


def _added(diagnosis: Diagnosis, belief: Belief, base: Kinds, kinds: Kinds, registry: Registry) -> EffectFit:
    """Return the fit of the explanation with one further effect; where it was not fitted, by one linear step."""
    first, second = diagnosis.fits[base], diagnosis.fits[kinds]
    known = diagnosis.fits.get(sorted_kinds((*base, *kinds)))
    if known is not None and math.isfinite(known.mean_square()):
        return known
    forms = (*first.candidate.forms, *second.candidate.forms)
    candidate = EffectSet.from_kinds(registry, (*base, *kinds), forms)
    slopes = np.column_stack([first.slopes, second.slopes])
    limits = (*first.at_limit, *second.at_limit)
    x = np.concatenate([first.x, np.zeros(len(second.x))])
    start = EffectFit(candidate, x, first.residual, slopes, True, limits, max(first.parts, second.parts))
    weight = belief.n_effective / (len(first.residual) * belief.square)
    pull = weight * slopes.T @ first.residual
    step = np.linalg.solve(information_matrix(start, belief.n_effective, belief.square), pull)
    return replace(start, x=np.clip(x + step, *candidate.limits()))
