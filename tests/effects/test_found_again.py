"""Five effects hidden in the runs of the menu that excite them: their parameters are recovered and they are named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.diagnosis.quick import REGISTRY, SIGMA, P, effect, make_fitter, make_predictor, measured

from pliant.diagnosis.candidates import EffectSet
from pliant.diagnosis.diagnosis import diagnose
from pliant.evidence.prediction import Predictor
from pliant.experiments.experiment_catalogue import timed_catalogue
from pliant.experiments.planned_run import BenchScale
from pliant.records.chain import ChainModel
from pliant.testing.samples import sample_chain, softening_law

# Values inside the plausible range, and modules of the chain.
HIDDEN: dict[str, tuple[dict[str, float], int]] = {
    "wall_thickness": ({"ratio": 1.1}, 1),
    "leak": ({"rate_1_s": 0.01}, 1),
    "bimodulus": ({"asymmetry": -0.15}, 1),
    "inertia": ({"scale": 1.0, "damping_ratio": 0.08}, 4),
    "tendon_friction": ({"friction": 0.2}, 3),
}
PLAIN_RUNS = ("slow_cycles", "fast_cycles", "load_steps", "passive_load_steps", "level")


def chain_for(kind: str) -> ChainModel:
    needed = REGISTRY.get("effect", kind).implementation_class().actuation
    law = softening_law()
    modules = HIDDEN[kind][1]
    law = replace(law, actuation_name=needed or law.actuation_name)
    return sample_chain(law, modules=modules, payload=0.03 / modules)


def bench(kind: str, seed: int) -> Predictor:
    """Return readings with coloured noise of two specimens in plain runs and in runs that excite the effect."""
    chain = chain_for(kind)
    runs = {run.name: run.history for run in timed_catalogue(BenchScale.from_chain(chain, P))}
    names = dict.fromkeys(
        (*PLAIN_RUNS, *REGISTRY.get("effect", kind).implementation_class().recommended_experiments)
    )
    histories = [
        runs[name].with_(run=f"{name} {body}", specimen=body)
        for body in "AB"
        for name in names
        if name in runs
    ]
    return make_predictor(chain, measured(chain, histories, effect(kind, **HIDDEN[kind][0]), seed=seed))


@pytest.mark.parametrize("kind", HIDDEN)
def test_its_numbers_come_back(kind: str) -> None:
    """The error is below six standard deviations for white noise; this noise is coloured (φ = 0.6)."""
    fit = make_fitter(bench(kind, 3), SIGMA).fit(EffectSet.from_kinds(REGISTRY, (kind,)))
    spread = np.sqrt(np.diag(np.linalg.inv(fit.slopes.T @ fit.slopes)))
    truth = np.array(
        [parameter.x(HIDDEN[kind][0][parameter.declared.name]) for parameter in fit.candidate.parameters]
    )
    assert np.all(np.abs(fit.x - truth) < 6.0 * spread), (fit.values, HIDDEN[kind])
    assert np.all(spread < 0.1)


@pytest.mark.slow
@pytest.mark.parametrize("kind", HIDDEN)
def test_it_is_named(kind: str) -> None:
    """The candidates are all shipped kinds, pairs of them and no effect."""
    found = diagnose(bench(kind, 4))
    assert (found.verdict, found.selected) == ("missing_effect", (kind,))
