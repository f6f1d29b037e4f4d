"""What a next run has to tell apart: the explanations that are left, or a settled verdict and what could still be missing.

A verdict is settled where the runs so far leave one explanation. The next run should then be the one most likely to
contradict it: the explanation alone competes with the explanation and one further effect of the list, each further
effect at the parameters that the runs so far leave possible, those that they determine least first.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pliant.diagnosis.candidates import NINETY, EffectSet
from pliant.diagnosis.diagnosis import Diagnosis
from pliant.diagnosis.effect_fit import EffectFit
from pliant.diagnosis.evidence_table import NOTHING, Kinds
from pliant.diagnosis.next_run import MOST_CONTENDERS, SMALL, Belief, information_matrix
from pliant.registry.discovery import Registry

# Probability of a settled explanation against all further effects together: even odds ask for the most telling run.
SETTLED = 0.5
Purpose = Literal["decide", "expose"]


@dataclass(frozen=True, eq=False)
class Question:
    """What a run has to tell apart.

    Attributes:
        purpose: decide between the explanations that are left, or expose what a settled one lacks.
        belief: the contenders with their probabilities; assumed ones where the purpose is to expose.
    """

    purpose: Purpose
    belief: Belief


def question(diagnosis: Diagnosis, registry: Registry) -> Question:
    """Return what the next run has to tell apart."""
    belief = Belief.from_fits(diagnosis.fits, diagnosis.judgement.probability, diagnosis.noise)
    settled = diagnosis.verdict in ("missing_effect", "nothing_missing", "law_off", "unknown_effect")
    if not settled and len(belief.contenders) > 1:
        return Question("decide", belief)
    return exposing(diagnosis, registry)


def exposing(diagnosis: Diagnosis, registry: Registry) -> Question:
    """Return the question what the most probable explanation lacks."""
    belief = Belief.from_fits(diagnosis.fits, diagnosis.judgement.probability, diagnosis.noise)
    base = diagnosis.explained
    rivals = [kinds for kinds in belief.contenders if kinds != base]
    further = [kinds for kinds in _least_determined(diagnosis, belief) if not set(kinds) & set(base)]
    fits = {base: diagnosis.fits[base]} | {kinds: diagnosis.fits[kinds] for kinds in rivals}
    for kinds in further:
        if len(fits) == MOST_CONTENDERS:
            break
        fits.setdefault((*base, *kinds), _added(diagnosis, base, kinds, registry))
    others = max(len(fits) - 1, 1)
    share = {kinds: SETTLED if kinds == base else max((1.0 - SETTLED) / others, SMALL) for kinds in fits}
    plain = {NOTHING: diagnosis.fits[NOTHING]}
    return Question(
        "expose", Belief(plain | fits, share, belief.n_effective, belief.square, belief.thresholds)
    )


def _least_determined(diagnosis: Diagnosis, belief: Belief) -> list[Kinds]:
    """Return the single effects, those first whose strength the runs so far restrict least."""
    spread = {}
    for kinds, fit in diagnosis.fits.items():
        if len(kinds) != 1 or not fit.candidate.parameters or not math.isfinite(fit.mean_square()):
            continue
        low, high = fit.candidate.parameters[0].plausible
        known = information_matrix(fit, belief.n_effective, belief.square)
        spread[kinds] = float(np.sqrt(np.linalg.inv(known)[0, 0])) * 2.0 * NINETY / (high - low)
    return sorted(spread, key=lambda kinds: -spread[kinds])


def _added(diagnosis: Diagnosis, base: Kinds, kinds: Kinds, registry: Registry) -> EffectFit:
    """Return the fit of the explanation with one further effect; unless it was fitted, the effect begins at no strength."""
    first, second = diagnosis.fits[base], diagnosis.fits[kinds]
    if base == NOTHING:
        return second
    forms = (*first.candidate.forms, *second.candidate.forms)
    candidate = EffectSet.from_kinds(registry, (*base, *kinds), forms)
    if len(candidate) != len(first.x) + len(second.x):
        return first
    return EffectFit(
        candidate,
        np.concatenate([first.x, np.zeros(len(second.x))]),
        first.residual,
        np.column_stack([first.slopes, second.slopes]),
        True,
        (*first.at_limit, *second.at_limit),
        max(first.parts, second.parts),
    )


def entropy_nats(probability: Mapping[Kinds, float]) -> float:
    """Return the entropy of the hypotheses' probabilities."""
    shares = np.array([value for value in probability.values() if value > 0.0])
    shares = shares / shares.sum()
    return float(-np.sum(shares * np.log(shares)))


def obtained_nats(before: Diagnosis, after: Diagnosis) -> float:
    """Return the information of the runs between two diagnoses: the fall of the entropy; negative where it rose."""
    return entropy_nats(before.judgement.probability) - entropy_nats(after.judgement.probability)
