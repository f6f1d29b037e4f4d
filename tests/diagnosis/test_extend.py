"""Add effects to a study's model."""

import numpy as np
import pytest
from tests.diagnosis.bench_files import STUDY, bench, histories, study
from tests.diagnosis.quick import BENCH, effect

from pliant.diagnosis import fitting
from pliant.diagnosis.extension import Ground, extend
from pliant.errors import UserError

WITH_STIFFNESS = (
    STUDY + "effects:\n  - {kind: stiffness, factor: 1.3}\n  - {kind: gravity_scale, factor: 1.0}\n"
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("joint")


def extended(folder, measurement, kinds, text=STUDY, **more):
    model = study(folder, text)
    return extend(Ground.from_study(BENCH, model, measurement), model.effects, kinds, **more)


def test_the_value_that_was_hidden_lies_in_the_interval(folder):
    found = extended(folder, bench(folder, effect("viscoelastic")), ["viscoelastic"])
    share, time = (
        found.uncertainty.estimate("viscoelastic.share"),
        found.uncertainty.estimate("viscoelastic.time_s"),
    )
    assert share.value == pytest.approx(0.3, abs=4 * share.sd)
    assert time.value == pytest.approx(12.0, abs=4 * time.sd)
    assert 0 < share.sd < 0.1
    assert found.before.over_floor > 1.5
    assert found.after.over_floor == pytest.approx(1.0, abs=0.1)
    assert found.after.over_floor <= found.heldout.over_floor < 1.2
    assert found.absent == ()


def test_rounded_values_predict_what_the_fit_predicts(folder):
    measurement = bench(folder, effect("mullins"))
    model = study(folder)
    ground = Ground.from_study(BENCH, model, measurement)
    found = extend(ground, model.effects, ["mullins"], profiles=False)
    errors = np.concatenate([run["angle_rad"] for run in ground.residuals(found.effects)])
    assert np.sqrt(np.mean(errors**2)) == pytest.approx(found.after.rmse["angle_rad"], rel=1e-3)
    for estimate in found.uncertainty.estimates:
        assert len(f"{found.values[estimate.name]:g}".replace(".", "").lstrip("0")) <= 4


def test_an_effect_in_the_study_is_refitted_in_place(folder):
    measurement = bench(folder, effect("stiffness", factor=1.15))
    found = extended(folder, measurement, ["stiffness"], WITH_STIFFNESS, profiles=False)
    assert [e.kind for e in found.effects] == ["stiffness", "gravity_scale"]
    assert found.effects[0].factor == pytest.approx(1.15, abs=0.02)
    assert found.effects[1].factor == 1.0  # not requested: unchanged
    assert found.before.over_floor > 1.5 > found.after.over_floor


def test_two_effects_are_fitted_together_and_others_keep_their_values(folder):
    measurement = bench(folder, effect("stiffness", factor=1.3), effect("sensor_bias"))
    found = extended(folder, measurement, ["sensor_bias"], WITH_STIFFNESS, profiles=False)
    assert [e.kind for e in found.effects] == ["stiffness", "gravity_scale", "sensor_bias"]
    assert found.effects[0].factor == 1.3
    assert found.effects[2].bias_rad == pytest.approx(0.03, abs=3e-3)
    found = extended(folder, measurement, ["stiffness", "sensor_bias"], profiles=False)
    assert found.values["stiffness.factor"] == pytest.approx(1.3, abs=0.02)
    assert found.values["sensor_bias.bias_rad"] == pytest.approx(0.03, abs=4e-3)
    assert found.uncertainty.correlation.shape == (2, 2)


def test_an_effect_that_is_not_there_or_not_excited_is_absent(folder):
    clean = bench(folder)
    assert extended(folder, clean, ["mullins"]).absent == ("mullins",)
    found = extended(folder, clean, ["thermal_softening"])
    assert found.absent == ("thermal_softening",)
    estimate = found.uncertainty.estimate("thermal_softening.loss_per_k")
    assert estimate.open_low and estimate.open_high and np.isinf(estimate.sd)
    twice = "effects: [{kind: viscoelastic, share: 0.1, time: 3 s}, {kind: viscoelastic, share: 0.1, time: 60 s}]\n"
    with pytest.raises(UserError, match="2 times"):
        extended(folder, clean, ["viscoelastic"], STUDY + twice)
    with pytest.raises(UserError, match="did you mean 'viscoelastic'"):
        extended(folder, clean, ["viscoelastik"])


def test_one_run_has_no_condition_to_leave_out(folder):
    measurement = bench(folder, effect("stiffness"), runs=histories(1)[:1])
    found = extended(folder, measurement, ["stiffness"], profiles=False)
    assert found.heldout is None and found.left_out is None
    assert found.values["stiffness.factor"] == pytest.approx(1.15, abs=0.05)


def test_beside_another_effect_a_fit_is_never_worse_than_alone(folder, monkeypatch):
    measurement = bench(folder, effect("viscoelastic"))
    alone = extended(folder, measurement, ["viscoelastic"], profiles=False)
    kinds = ["viscoelastic", "base_misalignment"]
    # without a step the joint fit stays at its start: there it has the smaller one's error, and can decrease further
    monkeypatch.setattr(fitting, "MOST_ITERATIONS", 0)
    monkeypatch.setattr(fitting, "TRIAL_ITERATIONS", 0)
    monkeypatch.setattr(fitting, "NEAR_ITERATIONS", 0)
    both = extended(folder, measurement, kinds, profiles=False, smaller=[alone])
    weights = np.ones(len(both.fit.residual))
    assert both.fit.cost(weights) <= alone.fit.cost(weights) * (
        1 + 1e-3
    )  # except for the law's own sensitivities
    assert both.fit.named.items() >= alone.fit.named.items()


def test_an_effect_that_runs_do_not_show_leaves_the_left_out_error_with_the_others_unchanged(folder):
    measurement = bench(folder, effect("stiffness", factor=1.3))
    alone = extended(folder, measurement, ["stiffness"], profiles=False)
    both = extended(folder, measurement, ["stiffness", "supply_lag"], profiles=False)
    assert alone.before.over_floor > 1.5
    assert both.heldout.over_floor == pytest.approx(alone.heldout.over_floor, rel=0.1)
