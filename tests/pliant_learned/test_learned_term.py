"""A learned term finds a hidden effect, is zero for clean data and outside its range, and is stored with a study."""

import json

import numpy as np
import pytest
from tests.diagnosis.bench_files import PRESSURE, bench, study
from tests.diagnosis.quick import (
    BENCH,
    REGISTRY,
    P,
    effect,
    joint,
    make_predictor,
    measured,
    ramp,
    rich,
)
from tests.slow import slow_among

from pliant.config.loading import load_study
from pliant.diagnosis.candidates import candidate_kinds
from pliant.diagnosis.diagnosis import diagnose, why
from pliant.diagnosis.extension import write_extended_study
from pliant.diagnosis.improvement import improve
from pliant.diagnosis.learned_term import learn
from pliant.diagnosis.left_out import condition_indices
from pliant.diagnosis.noise import noise_view
from pliant.diagnosis.readings import readings_over_floor
from pliant.errors import UserError
from pliant.evidence.error_bins import run_residuals
from pliant.measurements.repeats import repeat_groups
from pliant.mechanics.learned_curve import basis
from pliant.report.improvement import improvement_json, summary
from pliant.report.learned import learned_json, learned_section

KNOTS = np.linspace(0.0, PRESSURE, 25)


def bump(p):
    """Return a smooth excess of pressure that no listed effect describes, Pa."""
    return 2500.0 * np.exp(-(((p - 0.6 * PRESSURE) / (0.15 * PRESSURE)) ** 2))


BUMP = effect(
    "learned",
    acts_on="input",
    covariates=[{"name": "actuation", "low": 0.0, "high": PRESSURE}],
    value=bump(KNOTS).tolist(),
)


def learned(chain, measurement):
    model = make_predictor(chain, measurement)
    plain = run_residuals(measurement, model.predict())
    groups = repeat_groups(measurement)
    readings, _ = readings_over_floor(measurement, plain, groups)
    noise = noise_view(measurement, plain, readings.scales, groups)
    condition = condition_indices(readings.n_runs, [group.runs for group in groups])[readings.run]
    return learn(model, readings, noise, condition)


@pytest.fixture(scope="module")
def pressure_term():
    return learned(joint(), measured(joint(), rich(), BUMP))


def test_a_hidden_pressure_function_is_recovered_within_its_band(pressure_term):
    found = pressure_term
    assert found.form.acts_on == "input" and [axis.name for axis in found.form.axes] == ["actuation"]
    assert found.before > 1.5 and found.after < 1.15 and found.sure > 5.0
    p = np.linspace(0.05 * P, 0.95 * P, 60)
    weights = basis(found.form.axes, [p])
    sd = np.sqrt(np.einsum("tk,kl,tl->t", weights, found.covariance, weights))
    z = (weights @ found.value - bump(p)) / sd
    assert np.mean(np.abs(z) < 2.0) > 0.8 and np.abs(z).max() < 5.0


def test_what_a_joint_remembers_is_learned_as_a_memory():
    found = learned(joint(), measured(joint(), rich(1), effect("viscoelastic")))
    assert any(axis.has_memory for axis in found.form.axes)
    assert found.after < 0.75 * found.before


@pytest.mark.parametrize("seed", slow_among(range(3), 1, 2))
def test_nothing_is_offered_for_clean_data(seed):
    assert learned(joint(), measured(joint(), rich(), seed=seed)) is None


def test_it_says_nothing_where_it_has_no_data():
    low = [ramp(f"low{k}", rate, 0.5, (0.5 * P, 0.0, 0.5 * P, 0.0)) for k, rate in enumerate([1e3, 2e3] * 3)]
    early = effect(
        "learned",
        acts_on="input",
        covariates=[{"name": "actuation", "low": 0.0, "high": 0.5 * P}],
        value=[0.0, 400.0, 800.0, 400.0, 0.0],
    )
    found = learned(joint(), measured(joint(), low, early))
    assert [axis.name for axis in found.form.axes] == ["actuation"]
    high = ramp("high", 2e3, 0.5, (P, 0.65 * P, P))
    model = make_predictor(joint(), measured(joint(), [high]))
    (plain,), (with_it,) = model.predict(), model.predict((found.effect,))
    beyond = high.actuation["pressure_pa"] > 0.6 * P
    np.testing.assert_allclose(with_it["angle_rad"][beyond], plain["angle_rad"][beyond], atol=1e-7)


@pytest.mark.pixels
def test_it_is_drawn_with_its_band_and_told_as_plain_data(pressure_term):
    section = learned_section(pressure_term)
    assert section.pictures[0].png.tobytes().startswith(b"\x89PNG") and "no cause" in section.text[0]
    assert json.loads(json.dumps(learned_json(pressure_term)))["depends_on"] == ["actuation"]
    assert learned_section(None) is None and learned_json(None) is None
    (panel,) = section.pictures[0].chart.panels
    curve = next(line for line in panel.lines if line.name == "learned term")
    band = next(band for band in panel.bands if band.name == "90 % band")
    assert np.all(band.low <= curve.y) and np.all(curve.y <= band.high) and np.any(curve.y < band.high)


def test_it_is_no_search_candidate():
    kinds = candidate_kinds(REGISTRY)
    assert "learned" not in kinds and "stiffness" in kinds
    with pytest.raises(UserError, match="improve --learned"):
        candidate_kinds(REGISTRY, ["learned"])


@pytest.fixture(scope="module")
def improved(tmp_path_factory):
    folder = tmp_path_factory.mktemp("learned")
    measurement = bench(folder, BUMP)
    loaded = study(folder)
    return (
        folder,
        loaded,
        measurement,
        improve(BENCH, loaded, measurement, kinds=["sensor_bias"], learned=True),
    )


def test_improve_takes_it_as_its_last_step_and_scores_it_on_runs_put_aside(improved):
    _, _, measurement, found = improved
    last = found.steps[-1]
    assert last.added == ("learned",) and last.named == "a learned term" and found.learned is last.learned
    assert last.locked.over_floor < 0.6 * found.steps[-2].locked.over_floor
    assert last.locked.over_floor < 1.3
    assert "a description and no cause" in last.why and last.cause == "learned"
    assert "a learned term over pressure" in found.reason and "--learned" not in found.reason
    assert "stand" not in summary(found)  # it represents no kind: it only describes
    told = improvement_json(found, measurement)
    assert told["learned"]["rmse_over_floor"]["with"] < told["learned"]["rmse_over_floor"]["without"]


@pytest.mark.slow
def test_without_the_option_only_the_law_is_corrected(improved):
    _, loaded, measurement, _ = improved
    found = improve(BENCH, loaded, measurement, kinds=["sensor_bias"])
    assert all(step.cause != "learned" for step in found.steps)


def test_a_study_holds_it_as_data_and_is_the_old_one_without_it(improved):
    folder, loaded, _, found = improved
    target = folder / "new.yaml"
    source = folder / "joint.yaml"
    write_extended_study(source, target, loaded, (), found.final, "a note", REGISTRY, learned=found.learned)
    read = load_study(target, REGISTRY)
    assert read.effects[-1] == found.learned.effect
    assert "a description, no cause" in target.read_text()
    without = target.with_name("without.yaml")
    head = target.read_text().split("effects:")[0]
    without.write_text(head)
    assert load_study(without, REGISTRY).effects == loaded.effects == ()


def test_diagnose_offers_it_where_no_listed_effect_explains_the_error(tmp_path):
    measurement = bench(tmp_path, BUMP)
    found = diagnose(
        study_predictor(tmp_path, measurement), kinds=["sensor_bias", "viscoelastic", "thermal_softening"]
    )
    assert found.verdict == "unknown_effect" and found.learned is not None
    assert any("pliant improve --learned" in line for line in why(found, REGISTRY))


def study_predictor(folder, measurement):
    from pliant.evidence.prediction import Predictor

    return Predictor.from_study(BENCH, study(folder), measurement)
