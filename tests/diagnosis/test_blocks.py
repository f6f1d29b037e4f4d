"""Compare the predictions of two models by the squared errors of blocks."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from tests.diagnosis.quick import REGISTRY, make_measurement, rich

from pliant.diagnosis.candidates import EffectSet
from pliant.diagnosis.effect_fit import EffectFit
from pliant.diagnosis.readings import ReadingVector
from pliant.diagnosis.steps import shapes_at_bound
from pliant.diagnosis.unseen import best_single_effect, block_squares, prediction_gain


def test_blocks_hold_all_squares_and_readings_that_lack_count_none() -> None:
    rng = np.random.default_rng(0)
    runs = tuple({"angle_rad": rng.normal(size=n), "tip_x_m": rng.normal(size=n)} for n in (50, 31))
    runs[1]["angle_rad"][3:9] = np.nan
    scales = {"angle_rad": 0.5, "tip_x_m": 2.0}
    (blocks,) = block_squares([runs], scales)
    whole = sum(np.nansum((run[name] / scale) ** 2) for run in runs for name, scale in scales.items())
    assert blocks.sum() == pytest.approx(whole) and len(blocks) == 24


def test_a_gain_is_as_sure_as_the_paired_t_test() -> None:
    rng = np.random.default_rng(1)
    before, after = rng.chisquare(5, 24) + 1.0, rng.chisquare(5, 24)
    gain, d = prediction_gain(before, after), before - after
    assert gain.sure == pytest.approx(d.mean() / (d.std(ddof=1) / np.sqrt(24)))
    assert gain.share == pytest.approx(1.0 - after.sum() / before.sum())
    assert prediction_gain(after, before).sure == pytest.approx(-gain.sure)
    assert prediction_gain(before, before).sure == 0.0


def test_among_models_that_differ_by_chance_few_are_sure() -> None:
    rng = np.random.default_rng(2)
    sure = [prediction_gain(*rng.chisquare(10, (2, 24))).sure > 2.5 for _ in range(2000)]
    assert np.mean(sure) < 0.02


def test_blocks_are_short_where_the_models_fail() -> None:
    """A swing in the first tenth of a run is several blocks: a model that follows it is surely better."""
    rng, time = np.random.default_rng(4), np.linspace(0.0, 10.0, 1000)
    noise = rng.normal(size=time.shape)
    swing = 30.0 * np.exp(-2.0 * time) * np.sin(20.0 * time)
    models = [({"angle_rad": noise + share * swing},) for share in (1.0, 0.3)]
    gain = prediction_gain(*block_squares(models, {"angle_rad": 1.0}))
    assert gain.sure > 4.0
    assert prediction_gain(*block_squares([models[0], models[0]], {"angle_rad": 1.0})).sure == 0.0


def test_models_with_other_noise_are_seldom_sure() -> None:
    rng = np.random.default_rng(5)
    pairs = [[({"angle_rad": rng.normal(size=400)},) for _ in range(2)] for _ in range(1000)]
    sure = [prediction_gain(*block_squares(pair, {"angle_rad": 1.0})).sure > 2.5 for pair in pairs]
    assert np.mean(sure) < 0.02


@pytest.mark.parametrize(("worse", "chosen"), [(1.5, "supply_lag"), (1.0 + 1e-4, "viscous_damping")])
def test_from_look_alikes_the_one_that_predicts_better_is_taken_if_that_is_sure(worse, chosen):
    """Errors of the usual one are larger by a factor in every block, with an independent noise in the other."""
    runs = rich()
    blank = [{"angle_rad": np.zeros(len(run))} for run in runs]
    readings = ReadingVector.from_measurement(
        make_measurement(runs, blank), ("angle_rad",), {"angle_rad": 1.0}
    )
    rng = np.random.default_rng(3)

    def fit(size: float) -> EffectFit:  # without a parameter, so that the left-out error equals the residual
        residual = size * rng.standard_normal(len(readings))
        nothing = EffectSet.from_kinds(REGISTRY, ())
        return EffectFit(nothing, np.zeros(0), residual, np.zeros((len(readings), 0)), True, ())

    fits = {(): fit(1.0), ("viscous_damping",): fit(worse), ("supply_lag",): fit(1.0)}
    found = SimpleNamespace(fits=fits, readings=readings)
    assert (
        best_single_effect(found, ("viscous_damping", "supply_lag", "not_fitted"), "viscous_damping")
        == chosen
    )


def test_a_bound_at_which_an_effect_is_a_simpler_one_is_none():
    candidate = EffectSet.from_kinds(REGISTRY, ("supply_lag",))
    names = [parameter.declared.name for parameter in candidate.parameters]
    values = {"second_ratio": 0.01, "vent_ratio": 5.0, "time_s": 0.5}
    pairs = zip(candidate.parameters, names, strict=True)
    x = np.array([parameter.x(values[name]) for parameter, name in pairs])
    for ends, bound in (("second_ratio", False), ("vent_ratio", True)):
        at_limit = tuple(name == ends for name in names)
        fit = EffectFit(candidate, x, np.zeros(1), np.zeros((1, len(x))), True, at_limit)
        assert bool(shapes_at_bound({("supply_lag",): fit})["supply_lag",]) == bound
