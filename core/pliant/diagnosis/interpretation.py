"""A diagnosis in sentences that a bench scientist would use."""

from __future__ import annotations

from collections.abc import Sequence

from pliant.diagnosis.classes import EffectClass
from pliant.diagnosis.diagnosis import Diagnosis
from pliant.diagnosis.verdict import sentence_of
from pliant.formatting import listed, whole_percent
from pliant.measurements.plausible import TO_CHECK
from pliant.registry.discovery import Registry

MOST_NAMED = 4
WRONG_UNIT = "A unit in the file looks wrong (see the remarks): settle that first, then believe a verdict."


def headline(found: Diagnosis) -> str:
    """The verdict in one sentence."""
    return sentence_of(found.verdict, found.selected, found.judgement.credible)


def explanation(found: Diagnosis, registry: Registry) -> list[str]:
    """Why, what follows from it, and what to do next."""
    proposed = next_words(found)
    return [*why(found, registry), *([proposed] if proposed else [])]


def next_words(found: Diagnosis) -> str:
    """The run to do next; empty where the verdict needs none."""
    if found.next_run is None or found.verdict == "missing_effect":
        return ""
    return f"Next: {found.next_run.run} ({found.next_run.minutes:g} min): {found.next_run.why}."


def why(found: Diagnosis, registry: Registry) -> list[str]:
    """The reasons of the verdict, what gives the selected effects away, what the rest depends on."""
    lines = [WRONG_UNIT] if any(TO_CHECK in remark for remark in found.remarks) else []
    lines += found.judgement.reasons
    for kind in found.selected:
        notes = registry.get("effect", kind).implementation_class().notes
        if notes.signature:
            lines.append(f"{kind}: {notes.signature}")
        lines += _confused(found, kind)
    if found.verdict != "missing_effect":  # a selected effect stands out of its class
        first = [kind for kinds in found.judgement.credible for kind in kinds]
        lines += [class_words(one, first) for one in classes_at_issue(found)]
    if found.verdict in ("unknown_effect", "nothing_missing", "insufficient_data"):
        lines += _dependence(found)
    return lines


def classes_at_issue(found: Diagnosis) -> list[EffectClass]:
    """Classes with an effect of an explanation that is left."""
    left = {kind for kinds in found.judgement.credible for kind in kinds}
    return [one for one in found.classes if left & set(one.kinds)]


def class_words(one: EffectClass, first: Sequence[str] = ()) -> str:
    """Which effects look the same, those of `first` named first, and the run that parts them."""
    kinds = sorted(one.kinds, key=lambda kind: (kind not in first, kind))
    more = len(kinds) - MOST_NAMED
    names = kinds if more <= 1 else [*kinds[:MOST_NAMED], f"{more} more"]
    alike = f"At twice the noise these runs cannot tell {listed(names)} apart"
    if not one.run:
        return f"{alike}, and no run of the menu would."
    would = "would" if len(one.parts) == len(kinds) else f"would split them into {len(one.parts)} groups"
    return f"{alike}; the run '{one.run}' {would} ({one.words}, {one.minutes:g} min)."


def _confused(found: Diagnosis, kind: str) -> list[str]:
    """CataloguePrediction-alikes that these runs cannot exclude."""
    twins = [pair.b for pair in found.indistinguishable if pair.a == kind]
    if not twins:
        return []
    return [f"Under these runs {kind} can hardly be told from {' or '.join(twins[:MOST_NAMED])}."]


def _dependence(found: Diagnosis) -> list[str]:
    """What the residual of the best explanation depends on."""
    most = [(name, value) for name, value in found.depends_on.items() if value >= 0.1][:3]
    if not most:
        return []
    words = [f"{_circumstance(found, name)} ({whole_percent(value)})" for name, value in most]
    return [f"What is unexplained depends on {', '.join(words)}: shares of its variance on runs left out."]


def _circumstance(found: Diagnosis, name: str) -> str:
    """A covariate, or a pair of them, in words."""
    return " × ".join(found.circumstances.get(part, part) for part in name.split(" × "))
