"""Which hypotheses are fitted, and when the search grows."""

from __future__ import annotations

from tests.diagnosis.quick import REGISTRY, effect, fitter_of, joint, measured, predictor_of, rich

from pliant.diagnosis.candidates import EffectSet
from pliant.diagnosis.excitation import excitations
from pliant.diagnosis.search import MOST_EFFECTS, HypothesisSearch
from pliant.diagnosis.verdict import THRESHOLDS
from pliant.evidence.prediction import Predictor

KINDS = ["actuation_gain", "mullins", "sensor_bias", "stiffness"]


def searched(*hidden, kinds=KINDS, seed: int = 3) -> HypothesisSearch:
    chain = joint()
    measurement = measured(chain, rich(), *hidden, seed=seed)
    predictor: Predictor = predictor_of(chain, measurement)
    fitter = fitter_of(predictor)
    shown = excitations(REGISTRY, fitter, fitter.fit(EffectSet.of(REGISTRY, ())), kinds)
    search = HypothesisSearch(REGISTRY, measurement, fitter.readings, fitter, THRESHOLDS, shown)
    search.run(kinds)
    return search


def test_nothing_and_every_single_effect_are_always_fitted() -> None:
    search = searched()
    assert {(), *((kind,) for kind in KINDS)} <= set(search.fits)
    assert search.fits.keys() == search.rows.keys()


def test_it_does_not_grow_without_need() -> None:
    assert max(map(len, searched().fits)) == 1
    assert max(map(len, searched(effect("stiffness")).fits)) == 1


def test_it_grows_to_two_effects_and_fits_their_parts() -> None:
    search = searched(effect("stiffness", factor=1.05), effect("sensor_bias", bias_rad=0.006))
    pair = ("sensor_bias", "stiffness")
    assert pair in search.fits
    assert all(len(kinds) <= MOST_EFFECTS and kinds == tuple(sorted(kinds)) for kinds in search.fits)
    best = min(search.rows.values(), key=lambda row: row.mean_square)
    assert set(pair) <= set(best.kinds)
    assert search.rows[pair].mean_square <= min(search.rows[(kind,)].mean_square for kind in pair)


def test_one_candidate_cannot_grow() -> None:
    assert set(searched(effect("stiffness"), kinds=["mullins"]).fits) == {(), ("mullins",)}
