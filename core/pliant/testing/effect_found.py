"""Check that a diagnosis identifies an effect that is hidden in readings of its recommended runs.

The test object is a chain of three modules and two specimens of it, with coloured noise on every sensor. The candidates
are the effect, its look-alike and a few installed general kinds.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from pliant.diagnosis.diagnosis import Diagnosis, diagnose
from pliant.diagnosis.verdict import named
from pliant.errors import closest
from pliant.evidence.prediction import POSITION, Predictor
from pliant.experiments.experiment_catalogue import BUILDERS, timed_catalogue
from pliant.experiments.planned_run import BenchScale, PlannedRun
from pliant.formatting import listed
from pliant.interfaces.effect import EffectConfig, EffectParameter
from pliant.pipeline.workbench import RunContext
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.measurement import MeasuredRun, Measurement
from pliant.registry.discovery import Registry, discover
from pliant.store.store import ArtifactStore
from pliant.testing import CheckSkipped, Subject, once, require
from pliant.testing.effect_bench import follower, model_inputs, parameters, probe_run, sample_model
from pliant.testing.samples import PRESSURE_PA

PLAIN_RUNS = ("slow_cycles", "fast_cycles", "passive_load_steps")
GENERAL = ("stiffness", "actuation_gain", "viscoelastic", "friction_hysteresis", "sensor_bias")
SPECIMENS = ("A", "B")
PAYLOAD_KG = 0.01
INCLINED_M_S2 = np.array([3.0, 0.0, -9.34])
# Noise of an angle in rad and of a position as a share of the chain's length; correlation of neighbouring samples.
ANGLE_RAD, POSITION_SHARE, CORRELATION = 2e-3, 2e-3, 0.6
SEED = 3


def is_found_when_injected(subject: Subject) -> None:
    """hidden in its recommended and a few plain runs, the effect is identified, or a class of look-alikes with it."""
    kind, effect = subject.component.kind, type(subject.build())
    if not effect.fitted:
        raise CheckSkipped("its numbers are data: it is no candidate of a diagnosis")
    runs = _recommended_runs(subject, effect.recommended_experiments)
    predictor = _predictor(subject, _injected(subject, runs))
    found = diagnose(predictor, kinds=_candidates(subject), runs=runs[:1])
    if found.verdict == "missing_effect" and found.selected == (kind,):
        return
    left = found.judgement.credible
    single = {kinds[0] for kinds in left if len(kinds) == 1}
    classes = [set(one.kinds) for one in found.classes if kind in one.kinds]
    # The remaining candidates are single effects of one class, stated without readings, that has the kind.
    of_its_class = (kind,) in left and len(single) == len(left) and any(single <= one for one in classes)
    require(found.verdict == "ambiguous" and of_its_class, _told(subject, found))
    twin = effect.notes.confounder
    apart = f"its recommended runs do not distinguish it from {twin}, its look-alike"
    require((twin,) not in left, f"{apart}: name runs that do, or drop it for {twin}")


def _recommended_runs(subject: Subject, names: Sequence[str]) -> tuple[PlannedRun, ...]:
    """Return the effect's recommended and the plain runs at the scale of the sample chain, new specimens first."""
    known = list(BUILDERS)
    require(
        names,
        "no run is named that shows it: declare recommended_experiments = (…), names of runs of the menu that show "
        f"the effect and distinguish it from its look-alike ({', '.join(known)})",
    )
    for name in names:
        require(
            name in known,
            f"recommended_experiments names '{name}', which is no run of the menu{closest(name, known)}",
        )
    possible = {run.name: run for run in timed_catalogue(BenchScale.from_chain(_chain(subject), PRESSURE_PA))}
    none = f"none of its recommended runs ({', '.join(names)}) can be done on a chain driven by its input"
    require(any(name in possible for name in names), none)
    chosen = [possible[name] for name in dict.fromkeys((*names, *PLAIN_RUNS)) if name in possible]
    return tuple(sorted(chosen, key=lambda run: not run.new_specimen))


def _injected(subject: Subject, runs: Sequence[PlannedRun]) -> Measurement:
    """Return the readings of two specimens that have the effect at its typical strength."""
    outputs = tuple(dict.fromkeys(("angle_rad", *(name for run in runs for name in run.adds))))
    blank = []
    for specimen in SPECIMENS:
        for run in runs:
            history = run.history.with_(run=f"{run.name} {specimen}", specimen=specimen)
            read = ("angle_rad", *run.adds)
            values = {name: np.full(len(history), 0.0 if name in read else np.nan) for name in outputs}
            weights, rows = np.ones(len(history)), np.arange(2, len(history) + 2, dtype=float)
            blank.append(MeasuredRun(history, values, {}, weights, rows))
    unread = Measurement(tuple(blank), outputs, source="sample bench")
    truth = _predictor(subject, unread)
    effect = subject.configured(_typical(parameters(subject)))
    assert isinstance(effect, EffectConfig)
    readings = truth.predict((effect,))
    rng = np.random.default_rng(SEED)
    length_m = truth.chain.length_m
    filled = [
        run.with_outputs({name: run.outputs[name] + _noisy(rng, name, seen[name], length_m) for name in seen})
        for run, seen in zip(blank, readings, strict=True)
    ]
    return replace(unread, runs=tuple(filled))


def _typical(declared: Sequence[EffectParameter]) -> dict[str, float]:
    """Return strengths halfway from neutral to the far end of the plausible range, others in the middle of it.

    The middle is geometric for a log-normal prior.
    """
    values = {}
    for p in declared:
        low, high = p.plausible
        far = max(p.plausible, key=lambda value: abs(value - p.neutral))
        middle = (p.neutral + far) / 2 if p.role == "strength" else (low + high) / 2
        values[p.name] = math.sqrt(low * high) if p.prior == "log_normal" else middle
    return values


def _candidates(subject: Subject) -> tuple[str, ...]:
    """Return the effect, its look-alike and the general kinds, if they are installed."""
    installed = set(_registry(subject).kinds("effect"))
    asked = dict.fromkeys((subject.component.kind, type(subject.build()).notes.confounder, *GENERAL))
    found = tuple(one for one in asked if one in installed)
    if len(found) < 2:
        raise CheckSkipped("no other effect is installed for which it could be taken")
    return found


def _chain(subject: Subject) -> ChainModel:
    """Return the sample chain; on an inclined bench for an effect that a level one cannot have."""
    chain = sample_model(subject, payload=PAYLOAD_KG).chain
    everything = [probe_run(inputs=model_inputs(sample_model(subject)))]
    return chain.with_(gravity_m_s2=INCLINED_M_S2) if subject.build().unsuited(chain, everything) else chain


def _predictor(subject: Subject, measurement: Measurement) -> Predictor:
    context = RunContext(_registry(subject), ArtifactStore(Path(".pliant/store")))
    return Predictor(context, follower(subject), _chain(subject), measurement)


@once
def _registry(subject: Subject) -> Registry:
    """Return the installed plugins, with the component under test in place of its namesake."""
    mine = subject.component
    others = (c for c in discover().components if (c.interface, c.kind) != (mine.interface, mine.kind))
    return Registry((*others, mine))


def _noisy(rng: np.random.Generator, name: str, values: Array, length_m: float) -> Array:
    """Return values (t,) with stationary first-order autoregressive noise."""
    sigma = POSITION_SHARE * length_m if POSITION.fullmatch(name) else ANGLE_RAD
    noise = rng.normal(0.0, sigma, len(values))
    for k in range(1, len(noise)):
        noise[k] = CORRELATION * noise[k - 1] + math.sqrt(1.0 - CORRELATION**2) * noise[k]
    return values + noise


def _told(subject: Subject, diagnosis: Diagnosis) -> str:
    kind, names = subject.component.kind, type(subject.build()).recommended_experiments
    values = ", ".join(f"{name} {value:g}" for name, value in _typical(parameters(subject)).items())
    shares = ", ".join(
        f"{named(kinds)} {p:.0%}" for kinds, p in list(diagnosis.judgement.probability.items())[:3]
    )
    runs = listed(list(dict.fromkeys((*names, *PLAIN_RUNS))))
    seen = f"with {values} hidden in {runs} the diagnosis says: {diagnosis.judgement.sentence} ({shares}). "
    if kind in diagnosis.not_excited:
        return (
            seen
            + "These runs do not show it: name others in recommended_experiments, or widen the plausible range"
        )
    return (
        seen + "Name runs in recommended_experiments that distinguish it from these, or check whether it is "
        "equivalent to one of them"
    )
