"""Classes of effects that given runs cannot tell apart, and the run of a menu that would split each best.

Two effects belong together where neither can be told from the other: each imitates the other's change, its parameters
bent as they must be. Only the inputs and the model decide this, no reading does, so that a class can be stated before
anything is measured or unsealed. Classes are the connected parts of these pairs.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pliant.diagnosis.candidates import Candidate
from pliant.diagnosis.excitation import SEPARABLE, TYPICAL_SNR, Excitation, LookAlike, look_alikes
from pliant.diagnosis.menu_view import Look, MenuView
from pliant.diagnosis.table import Kinds
from pliant.records.design import Array
from pliant.registry.discovery import Registry


@dataclass(frozen=True)
class EffectClass:
    """Effects that these runs cannot tell apart.

    Attributes:
        kinds: sorted by name, two or more.
        run, words, minutes: the run that splits it best, by name and as an order; empty where none does.
        parts: what it would be split into.
    """

    kinds: Kinds
    run: str = ""
    words: str = ""
    minutes: float = 0.0
    parts: tuple[Kinds, ...] = ()


def classes_of(found: Mapping[str, Excitation], n_effective: float) -> tuple[Kinds, ...]:
    """Classes of two or more effects, the largest first.

    Args:
        found: every excited effect at the far end of its plausible range under these runs.
        n_effective: independent readings of these runs.
    """
    return connected(found, look_alikes(found, {}, n_effective))


def connected(kinds: Iterable[str], pairs: Sequence[LookAlike]) -> tuple[Kinds, ...]:
    """Connected parts of two or more kinds, of pairs that are look-alikes both ways."""
    alike = {(pair.a, pair.b) for pair in pairs}
    left, classes = sorted(kinds), []
    while left:
        part, waiting = [], [left[0]]
        while waiting:
            kind = waiting.pop()
            if kind in part:
                continue
            part.append(kind)
            waiting += [other for other in left if (kind, other) in alike and (other, kind) in alike]
        left = [kind for kind in left if kind not in part]
        if len(part) > 1:
            classes.append(tuple(sorted(part)))
    return tuple(sorted(classes, key=lambda kinds: (-len(kinds), kinds)))


def split_classes(
    registry: Registry,
    view: MenuView,
    found: Mapping[str, Excitation],
    n_effective: float,
    classes: Sequence[Kinds] | None = None,
) -> tuple[EffectClass, ...]:
    """Each class with the run of the menu that splits it into the most parts; the shortest of equals.

    Args:
        registry: the installed effects.
        view: the model in the menu.
        found, n_effective: as for `classes_of`.
        classes: those of `classes_of` by default.
    """
    classes = classes_of(found, n_effective) if classes is None else classes
    kinds = sorted({kind for one in classes for kind in one})
    if not kinds:
        return ()
    changes = menu_changes(registry, view, {kind: found[kind] for kind in kinds})
    return tuple(_split(one, view, found, changes, n_effective) for one in classes)


def menu_changes(registry: Registry, view: MenuView, found: Mapping[str, Excitation]) -> dict[str, Look]:
    """What each effect changes in the menu at the strength of its excitation, and its slopes there; 0 for NaN."""
    nothing = view.look(Candidate.of(registry, ()), np.zeros(0)).values
    changes = {}
    for kind, one in found.items():
        look = view.look(Candidate.of(registry, (kind,)), one.x)
        lost = ~(np.isfinite(look.values - nothing) & np.isfinite(look.slopes).all(axis=1))
        changes[kind] = Look(
            np.where(lost, 0.0, look.values - nothing), np.where(lost[:, None], 0.0, look.slopes)
        )
    return changes


def _split(
    kinds: Kinds, view: MenuView, found: Mapping[str, Excitation], changes: Mapping[str, Look], n: float
) -> EffectClass:
    best = EffectClass(kinds, parts=(kinds,))
    rank: tuple[float, ...] = (1.0, 0.0)
    for index, run in enumerate(view.runs):
        parts = parts_after(kinds, view, [index], changes, found, n)
        here = (float(len(parts)), -run.minutes)
        if len(parts) > 1 and here > rank:
            best, rank = EffectClass(kinds, run.name, run.words, run.minutes, parts), here
    return best


def parts_after(
    kinds: Sequence[str],
    view: MenuView,
    chosen: Sequence[int],
    changes: Mapping[str, Look],
    found: Mapping[str, Excitation] | None = None,
    n: float = 0.0,
) -> tuple[Kinds, ...]:
    """The parts that these kinds fall into once the chosen runs of the menu are there beside the measured ones.

    Kinds that change nothing in any of these runs stay together.
    """
    rows = view.rows(chosen)
    root = np.sqrt(view.worth[rows])
    vectors = {}
    for kind in kinds:
        change, slopes = changes[kind].values[rows] * root, changes[kind].slopes[rows] * root[:, None]
        size = np.sqrt(float(change @ change) / max(float(view.worth[rows].sum()), 1e-12))
        if found is not None:
            old, share = found[kind], np.sqrt(n / len(found[kind].change))
            change = np.concatenate([change, share * old.change])
            slopes = np.concatenate([slopes, share * old.slopes])
            size = max(old.snr, size)
        vectors[kind] = (change, slopes, size)
    apart = {(a, b): _distance(vectors[a], vectors[b]) >= SEPARABLE for a in kinds for b in kinds if a != b}
    pairs = [LookAlike(a, b, 0.0) for (a, b), split in apart.items() if not split]
    whole = connected(kinds, pairs)
    alone = [(kind,) for kind in kinds if not any(kind in part for part in whole)]
    return (*whole, *alone)


def _distance(a: tuple[Array, Array, float], b: tuple[Array, Array, float]) -> float:
    """n · SNR² · unexplained share: Σ of squares of a's change, at a typical strength, that b cannot imitate."""
    change, _, size = a
    if size <= 0.0:
        return 0.0
    basis = np.column_stack([b[0], b[1]])
    basis = basis[:, np.abs(basis).max(axis=0, initial=0.0) > 0.0]
    target = change * min(size, TYPICAL_SNR) / size
    if basis.shape[1]:
        target = target - basis @ np.linalg.lstsq(basis, target, rcond=1e-8)[0]
    return float(target @ target)
