"""Excitation of effects by given runs: those that they excite, cannot distinguish, or could detect."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pliant.diagnosis.candidates import EffectSet, FitParameter
from pliant.diagnosis.effect_fit import EffectFit
from pliant.diagnosis.evidence_table import LAW, EvidenceThresholds, Kinds
from pliant.diagnosis.fitting import Fitter, exclusion_reason
from pliant.diagnosis.law_discrepancy import LawReference
from pliant.diagnosis.law_posterior import Whitener
from pliant.errors import UserError
from pliant.execution.executors import Executor, InlineExecutor
from pliant.execution.jobs import JobQueue
from pliant.records.design import Array
from pliant.registry.discovery import Registry

# Strength, in σ, at which two effects are tested for distinguishability.
TYPICAL_SNR = 2.0
# Below this many units of n_eff · SNR² · unexplained share two effects look the same. Log-odds of two effects are
# about normal with mean m and variance 2 m, m = n_eff · SNR² · share / 2 / (1 + 0.3²); at this value 19 of 20 samples
# reach the odds of 9 : 1, halved by the temperature, that a verdict needs.
SEPARABLE = 28.0
# Directions of an effect below this share of its strongest are dropped.
SMALLEST = 1e-8


@dataclass(frozen=True, eq=False)
class Excitation:
    """One effect at the far end of its plausible range, under these runs.

    Attributes:
        kind: the effect.
        strength: its strength as a fit parameter.
        place: its index.
        x: (k,) the parameters there.
        snr: RMS change of the readings over the noise floor.
        change: (N,) that change; 0 where there is no equilibrium.
        slopes: (N, k) d prediction / dx there.
    """

    kind: str
    strength: FitParameter
    place: int
    x: Array
    snr: float
    change: Array
    slopes: Array


@dataclass(frozen=True)
class ConfoundedPair:
    """Two effects that these runs can hardly separate; share of a's change that b cannot imitate."""

    a: str
    b: str
    unexplained_share: float


@dataclass(frozen=True)
class Detectable:
    """The smallest strength at which an effect would be detected under these runs."""

    kind: str
    parameter: str
    value: float
    unit: str


def applicable(
    registry: Registry, fitter: Fitter, kinds: Sequence[str], executor: Executor | None = None
) -> tuple[list[str], dict[str, str]]:
    """Return the kinds applicable to this chain, and the others with the plugin's reason, without its advice."""
    reasons: dict[str, str] = {}
    asked: dict[str, tuple[EffectSet, Array]] = {}
    predictor = fitter.predictor
    for kind in kinds:
        try:
            candidate = EffectSet.from_kinds(registry, (kind,))
            start = candidate.starts()[0]
            effect = predictor.context.build("effect", candidate.configs(start)[0])
        except UserError as error:
            reasons[kind] = exclusion_reason(error)
            continue
        if unsuited := predictor.unsuited(effect):
            reasons[kind] = unsuited
        else:
            asked[kind] = candidate, start
    with JobQueue(executor or InlineExecutor(), fitter.check_applicable) as queue:
        for kind, one in zip(asked, queue.each(list(asked.values())), strict=True):
            if refusal := one.unwrap():
                reasons[kind] = refusal
    return [kind for kind in kinds if kind not in reasons], {k: reasons[k] for k in kinds if k in reasons}


def excitations(
    registry: Registry,
    fitter: Fitter,
    nothing: EffectFit,
    kinds: Sequence[str],
    executor: Executor | None = None,
) -> dict[str, Excitation]:
    """Return every effect at the end of its plausible strength, with shapes in the middle of their range."""
    candidates = [EffectSet.from_kinds(registry, (kind,)) for kind in kinds]
    if fitter.predictor.costly_slopes:
        with JobQueue(executor or InlineExecutor(), fitter.stronger_end_from) as queue:
            chosen = [one.unwrap() for one in queue.each([(c, _ends(c), nothing) for c in candidates])]
        asked = [(c, end, nothing.parts) for c, end in zip(candidates, chosen, strict=True)]
    else:
        asked = [(c, end, nothing.parts) for c in candidates for end in _ends(c)]
    found: dict[str, Excitation] = {}
    with JobQueue(executor or InlineExecutor(), fitter.evaluate_from) as queue:
        for (candidate, end, _), one in zip(asked, queue.each(asked), strict=True):
            fit = one.unwrap()
            change, slopes, snr = _seen(nothing.raw - fit.raw, fit.slopes)
            kind, place = candidate.kinds[0], _strength(candidate)
            if kind not in found or snr > found[kind].snr:
                found[kind] = Excitation(kind, candidate.parameters[place], place, end, snr, change, slopes)
    return found


def _seen(change: Array, slopes: Array) -> tuple[Array, Array, float]:
    """Return change (N,) and slopes (N, k), 0 where there is no equilibrium, and the RMS change elsewhere.

    The RMS change is 0 if more than half of the readings have no equilibrium.
    """
    there = np.isfinite(change) & np.isfinite(slopes).all(axis=1)
    snr = float(np.sqrt(np.mean(change[there] ** 2))) if 2 * there.sum() > len(there) else 0.0
    return np.where(there, change, 0.0), np.where(there[:, None], slopes, 0.0), snr


def explained_by(residual: Array, shown: Excitation) -> float:
    """Return the sum of squares of a residual (N,) that an effect's change and slopes explain to first order."""
    return explained_by_columns(residual, np.column_stack([shown.change, shown.slopes]))


def explained_by_columns(residual: Array, columns: Array) -> float:
    """Return the sum of squares of a residual (N,) in the span of columns (N, k)."""
    there = np.isfinite(residual) & np.isfinite(columns).all(axis=1)
    left, sizes, _ = np.linalg.svd(columns[there], full_matrices=False)
    along = left[:, sizes > SMALLEST * sizes.max(initial=0.0)].T @ residual[there]
    return float(along @ along)


def not_excited(excitations: Mapping[str, Excitation], thresholds: EvidenceThresholds) -> tuple[str, ...]:
    """Return kinds whose change stays below the limit at every plausible strength."""
    return tuple(kind for kind, one in excitations.items() if one.snr < thresholds.excited)


def confounded_with(
    excitations: Mapping[str, Excitation],
    fits: Mapping[Kinds, EffectFit],
    n: float,
    law: LawReference | None = None,
) -> tuple[ConfoundedPair, ...]:
    """Return pairs of excited effects that n effective readings cannot separate at a typical strength.

    b imitates a by its change and its slopes, at the plausible strength and at its fit: the least squares residual of
    a's change on these distinguishes them. With `law`, a large error of the law may accompany either effect; it is also
    a kind, `LAW`, which is paired with every effect that it imitates.
    """
    excited = [one for one in excitations.values() if one.snr > 0.0]
    whitener = (
        None
        if law is None
        else Whitener.from_sensitivities(law.columns, law.precision_at(law.prior.large, n))
    )
    pairs = []
    for b in excited:
        others = [a for a in excited if a.kind != b.kind]
        for a, share in zip(others, _unexplained(others, b, fits.get((b.kind,)), whitener), strict=True):
            if n * min(a.snr, TYPICAL_SNR) ** 2 * share < SEPARABLE:
                pairs.append(ConfoundedPair(a.kind, b.kind, share))
    for a in excited if whitener is not None else []:
        assert whitener is not None
        share = _square(whitener.apply(a.change)) / max(_square(a.change), 1e-300)
        if n * min(a.snr, TYPICAL_SNR) ** 2 * share < SEPARABLE:
            pairs += [ConfoundedPair(a.kind, LAW, share), ConfoundedPair(LAW, a.kind, share)]
    place = {kind: k for k, kind in enumerate([*excitations, LAW])}
    return tuple(sorted(pairs, key=lambda pair: (pair.unexplained_share, place[pair.a])))


def _square(values: Array) -> float:
    return float(values @ values)


def detectable(
    excitations: Mapping[str, Excitation],
    n: float,
    thresholds: EvidenceThresholds,
    law: LawReference | None = None,
) -> tuple[Detectable, ...]:
    """Return for each effect the strength at which it would be accepted over "nothing", with proportional changes.

    It must exceed its penalty, the part that a slightly wrong law explains alone, and the odds that a verdict needs.
    With `law`, the part that the law's own error can imitate does not count.
    """
    whitener = (
        None
        if law is None
        else Whitener.from_sensitivities(law.columns, law.precision_at(law.prior.large, n))
    )
    odds = thresholds.temperature * np.log(thresholds.accepted / (1.0 - thresholds.accepted))
    price = 2.0 * (thresholds.price(1, len(excitations)) + 0.5 * np.log(max(n, 2.0)) + odds)
    smallest = float(np.sqrt((1.0 + thresholds.excited**2) * np.exp(price / max(n, 2.0)) - 1.0))
    results = []
    for one in excitations.values():
        if one.snr <= 0.0:
            continue
        seen = one.change if whitener is None else whitener.apply(one.change)
        share = np.sqrt(_square(seen) / max(_square(one.change), 1e-300))
        x = float(one.x[one.place]) * smallest / max(one.snr * float(share), 1e-300)
        low, high = one.strength.limits
        if low <= x <= high:
            parameter = one.strength.declared
            results.append(Detectable(one.kind, parameter.name, one.strength.value(x), parameter.unit))
    return tuple(results)


def _strength(candidate: EffectSet) -> int:
    return next((k for k, parameter in enumerate(candidate.parameters) if parameter.is_strength), 0)


def _ends(candidate: EffectSet) -> list[Array]:
    """Return points with the strength at each end of its plausible range, all else in the middle."""
    middle = np.array([sum(parameter.plausible) / 2 for parameter in candidate.parameters])
    place = _strength(candidate)
    points = []
    for end in candidate.parameters[place].plausible:
        point = middle.copy()
        point[place] = end
        points.append(point)
    return points


def _unexplained(
    others: Sequence[Excitation], b: Excitation, fitted: EffectFit | None, whitener: Whitener | None
) -> list[float]:
    """Return the share of each other's squared change that is orthogonal to b's directions.

    With a `whitener`, the possible changes by the law's own error are removed first.
    """
    basis = np.column_stack([b.change, b.slopes, *([] if fitted is None else [fitted.slopes])])
    there = np.all(np.isfinite(basis), axis=1)
    changes = [a.change for a in others]
    if whitener is not None and there.all():
        basis, changes = whitener.apply(basis), [whitener.apply(change) for change in changes]
    upright, triangle = np.linalg.qr(
        basis[there]
    )  # cheaper for many readings than the next step on all of them
    turned, size, _ = np.linalg.svd(triangle)
    directions = upright @ turned[:, size > SMALLEST * size.max(initial=0.0)]
    shares = []
    for a, change in zip(others, changes, strict=True):
        target, whole = change[there], a.change[there]
        rest = target - directions @ (directions.T @ target)
        shares.append(float(np.clip(rest @ rest / (whole @ whole), 0.0, 1.0)))
    return shares
