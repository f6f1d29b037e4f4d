"""The whole loop on benches whose missing effects are known."""

from dataclasses import replace

import numpy as np
import pytest
from tests.diagnosis.bench_files import PRESSURE, bench, histories, study
from tests.diagnosis.quick import BENCH, REGISTRY, blank, colour, effect, make_measurement, ramp
from tests.report.pages import check_sound
from tests.report.test_first_screen import LABELS, folded, labels_before_the_picture

from pliant.diagnosis.data_split import split_runs
from pliant.diagnosis.improvement import _Walk, improve
from pliant.diagnosis.noise import NoiseView
from pliant.diagnosis.readings import Score
from pliant.evidence.prediction import Predictor
from pliant.report.chart import ChartNote
from pliant.report.improvement import improvement_document, summary
from pliant.report.improvement_charts import steps_chart
from pliant.report.render import page

FEW = ["stiffness", "viscoelastic", "sensor_bias", "mullins", "friction_hysteresis"]


def improved(folder, *hidden, runs=None, **more):
    measurement = bench(folder, *hidden, runs=runs)
    return improve(BENCH, study(folder), measurement, **{"kinds": FEW, **more})


def added(found):
    return [kind for step in found.steps for kind in step.added]


def shifted(measurement, which, by_rad):
    runs = [
        run.with_outputs({"angle_rad": run.outputs["angle_rad"] + by_rad * (k in which)})
        for k, run in enumerate(measurement.runs)
    ]
    return replace(measurement, runs=tuple(runs))


@pytest.fixture(scope="module")
def creeping(tmp_path_factory):
    """Return a bench that creeps, and the result of `improve` on it."""
    folder = tmp_path_factory.mktemp("creeping")
    measurement = bench(folder, effect("viscoelastic"))
    return study(folder), measurement, improve(BENCH, study(folder), measurement, kinds=FEW)


def test_a_hidden_effect_is_added_and_the_error_falls_to_the_floor(creeping):
    found = creeping[2]
    assert added(found) == ["viscoelastic"]
    assert found.stop == "nothing_missing"
    assert found.steps[0].added == () and found.steps[0].locked.over_floor > 1.4
    assert found.steps[-1].locked.over_floor < 1.2
    assert found.floors["angle_rad"].source == "repeats"
    assert 0 < found.steps[-1].locked_se < 0.3
    left = found.steps[-1].locked
    assert found.reason.startswith(f"The error that is left is {left.over_floor:.2f} ± ")
    assert "The error is spread over all conditions" in found.steps[0].why  # the reason for the next step
    assert "creeps" in found.steps[-1].why and "No condition stands out" in found.steps[-1].why
    # an error has one size, that in the record
    assert not any("times" in step.why.partition("times the noise")[2] for step in found.steps)
    before, after = (step.training.over_floor for step in found.steps)
    assert f"left out of the fit from {before:.2f} to {after:.2f} times the noise" in found.steps[-1].why
    assert "times" not in found.steps[0].why
    share = found.final.uncertainty.estimate("viscoelastic.share")
    assert share.value == pytest.approx(0.3, abs=4 * share.sd)
    assert "falls" in summary(found)
    assert found.final.effects == found.steps[-1].effects  # the reported error is the scored one


@pytest.mark.slow
def test_an_improvement_answers_them_and_its_reasons_are_text(creeping):
    _, measurement, found = creeping
    made = page(improvement_document("finger", measurement, found, REGISTRY))
    assert labels_before_the_picture(made.html) == LABELS
    assert folded(made.html)["Step by step"]
    text = check_sound(made)
    assert all(step.why in text for step in found.steps) and found.reason in text


def test_the_picture_for_an_improvement_has_labels_only(creeping):
    chart = steps_chart(creeping[2])
    texts = [
        text for panel in chart.panels for text in (panel.title, panel.x.text, panel.y.text, *panel.x.names)
    ]
    texts += [note.text for panel in chart.panels for note in panel.select(ChartNote)]
    texts += [mark.name for panel in chart.panels for mark in panel.marks]
    assert max(len(text.split()) for text in texts) <= 8
    assert not any(step.why in text for step in creeping[2].steps for text in texts)


@pytest.mark.slow
def test_two_hidden_effects_are_added_one_after_the_other(tmp_path):
    found = improved(tmp_path, effect("stiffness", factor=1.3), effect("sensor_bias", bias_rad=0.02))
    assert sorted(added(found)) == ["sensor_bias", "stiffness"]
    ratios = [step.locked.over_floor for step in found.steps]
    assert ratios[0] > ratios[1] > ratios[2]
    assert ratios[2] < 1.2


@pytest.mark.slow
def test_a_clean_bench_takes_no_step(tmp_path):
    found = improved(tmp_path, kinds=None)
    assert added(found) == [] and found.final is None
    assert found.stop == "nothing_missing"
    assert found.steps[0].locked.over_floor == pytest.approx(1.0, abs=0.25)
    assert "No effect was added" in summary(found)


@pytest.mark.pixels
@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("hidden", [(), (effect("stiffness", factor=1.2),)])
def test_readings_from_a_simulator_without_any_noise(tmp_path, hidden):
    """The hidden effect is added, errors are given in their own unit, and the page is drawn."""
    model, runs = study(tmp_path), histories()
    read = Predictor.from_study(BENCH, model, blank(runs)).predict(hidden)
    measurement = make_measurement(runs, read)
    found = improve(BENCH, model, measurement, kinds=["stiffness", "sensor_bias", "viscoelastic"])
    assert added(found) == [one.kind for one in hidden]
    said = summary(found)
    assert "° rms in bend angle" in said and "noise" not in said and "nan" not in said + found.reason
    assert all("nan" not in step.why for step in found.steps)
    check_sound(page(improvement_document("simulated", measurement, found, REGISTRY)))


@pytest.mark.slow
def test_without_repeats_nothing_is_called_noise(tmp_path):
    found = improved(tmp_path, runs=histories(1))
    assert added(found) == [] and found.stop == "insufficient_data"
    assert not found.judged
    assert any("may still be noise" in remark for remark in found.remarks)


@pytest.mark.slow
def test_no_more_effects_than_asked_for(tmp_path):
    found = improved(tmp_path, effect("viscoelastic"), most_steps=0)
    assert added(found) == [] and found.stop == "most_steps"


@pytest.mark.slow
def test_locked_readings_decide_nothing(creeping):
    """Corrupted readings in the held-out runs change the report and never the choice."""
    model, measurement, first = creeping
    second = improve(BENCH, model, shifted(measurement, first.locked.runs, 0.5), kinds=FEW)
    assert second.final.effects == first.final.effects
    assert second.steps[-1].locked.rmse["angle_rad"] > 10 * first.steps[-1].locked.rmse["angle_rad"]


@pytest.mark.slow
def test_too_few_runs_to_lock_are_said(tmp_path):
    found = improved(tmp_path, effect("stiffness", factor=1.3), runs=histories(1)[:2])
    assert found.locked.runs == ()
    assert any("rather than of runs not used in any fit" in remark for remark in found.remarks)
    assert np.isfinite(found.steps[0].locked.over_floor)


@pytest.mark.slow
def test_an_error_that_only_the_locked_runs_show_is_said(tmp_path):
    """A look-alike fits the training runs: the unseen condition reveals the error, and the report states it."""
    measurement = bench(tmp_path, effect("stiffness", factor=1.3))
    drifted = shifted(measurement, split_runs(measurement).unseen, 0.03)
    found = improve(BENCH, study(tmp_path), drifted, kinds=FEW)
    assert found.stop == "nothing_missing"
    assert any("still" in remark and "in no other run" in remark for remark in found.remarks)
    assert "noise, " not in found.reason and "and yet it is" in found.reason


@pytest.fixture(scope="module")
def walked(creeping):
    """Return a walk whose first diagnosis has been made."""
    model, measurement, _ = creeping
    walk = _Walk(BENCH, model, measurement, FEW[:2], None, 1, None)
    walk._diagnose()
    return walk


@pytest.mark.parametrize(
    ("stop", "locked", "training", "begins"),
    [
        (
            "unknown_effect",
            1.04,
            1.05,
            "The model is right to 1.04 ± 0.06 times the noise; no listed effect explains",
        ),
        (
            "unknown_effect",
            2.4,
            2.3,
            "Something is missing, and it is not in the list: the error is 2.40 ± 0.06",
        ),
        (
            "unknown_effect",
            1.04,
            1.9,
            "Something is missing, and it is not in the list: the error is 1.90 ± ",
        ),
        (
            "nothing_missing",
            1.04,
            1.0,
            "The error that is left is 1.04 ± 0.06 times the noise, which noise alone may leave",
        ),
        (
            "nothing_missing",
            1.5,
            1.0,
            "No listed effect lowers the error of the training runs any further, and yet",
        ),
        ("no_gain", 1.04, 1.0, "The model is right to 1.04 ± 0.06 times the noise. Own words."),
        ("no_gain", 1.5, 1.0, "Own words."),
        (
            "nothing_missing",
            np.nan,
            np.nan,
            "No listed effect lowers the error of the training runs any further; it",
        ),
        (
            "unknown_effect",
            np.nan,
            np.nan,
            "Something is missing, and it is not in the list: no listed effect",
        ),
    ],
)
def test_the_closing_sentence_is_about_what_is_left(creeping, walked, stop, locked, training, begins):
    """One verdict has different sentences, depending on the error on the held-out runs relative to the noise."""
    found = creeping[2]
    noise = NoiseView({}, 200.0, 1.0, True, 1.0)
    last = replace(
        found.steps[-1], locked=Score({}, locked, 100), training=Score({}, training, 100), locked_se=0.06
    )
    said = walked._closing(stop, "Own words." if stop == "no_gain" else "", last, noise)
    assert said.startswith(begins)


LAGS = ("sensor_lag", "supply_lag", "viscous_damping")


def one_slow_noisy_run(folder, *hidden):
    """Return a run without load: delays of the supply, the body and the camera are indistinguishable."""
    levels = (0.4 * PRESSURE, 0.0, 0.7 * PRESSURE, 0.0, PRESSURE, 0.0, PRESSURE, 0.0)
    clean = bench(folder, *hidden, runs=[ramp("only", 6e3, 0.25, levels)]).runs[0]
    noise = colour(np.random.default_rng(1), len(clean), 0.03, 0.9)
    return make_measurement([clean.history], [{"angle_rad": clean.outputs["angle_rad"] + noise}])


@pytest.mark.slow
def test_one_among_several_look_alikes_stands_for_all(tmp_path):
    measurement = one_slow_noisy_run(tmp_path, effect("supply_lag"))
    found = improve(BENCH, study(tmp_path), measurement, kinds=[*LAGS, "stiffness", "sensor_bias"])
    step = found.steps[1]
    assert len(found.steps) == 2 and step.added[0] in LAGS
    assert {"supply_lag", *step.added} <= set(step.stands_for) <= set(LAGS)
    assert "stands for one of" in step.why and "the run that would is" in step.why
    assert step.training.over_floor < 0.6 * found.steps[0].training.over_floor  # blocks left out
    assert " (or " in step.named and step.named in summary(found)
    assert "cannot be distinguished here from" in summary(found)
    assert found.scored_on == "blocks left out"
    assert found.final.effects == step.effects  # the scored effects are kept


@pytest.mark.slow
def test_noise_alone_has_no_stand_in(tmp_path):
    """`nothing` is too probable for the look-alikes to share the probability."""
    found = improve(BENCH, study(tmp_path), one_slow_noisy_run(tmp_path), kinds=[*LAGS, "sensor_bias"])
    assert added(found) == []


def test_prediction_takes_a_step_that_no_verdict_names(tmp_path):
    """The errors of the only run are far from independent: too few to identify a cause, enough to predict better."""
    measurement = one_slow_noisy_run(tmp_path, effect("actuation_gain", gain=1.3))
    few = replace(measurement, runs=tuple(_thinned(run, 12) for run in measurement.runs))
    found = improve(BENCH, study(tmp_path), few, kinds=["actuation_gain", "pressure_offset", "backlash"])
    strict = improve(BENCH, study(tmp_path), few, kinds=["actuation_gain", "backlash"], named_only=True)
    assert added(strict) == [] and strict.stop == "ambiguous"
    assert added(found)[0] == "actuation_gain" and found.steps[1].cause == "open"
    assert found.steps[1].locked.over_floor < 0.8 * found.steps[0].locked.over_floor
    assert "not because these data name it" in found.steps[1].why
    assert "Nothing is named as the cause; actuation_gain" in summary(found)


def _thinned(run, every):
    h = run.history
    kept = {name: values[::every] for name, values in run.outputs.items()}
    history = h.with_(
        time_s=h.time_s[::every],
        actuation={name: values[::every] for name, values in h.actuation.items()},
        tip_force_n=h.tip_force_n[::every],
        moment_n_m=h.moment_n_m[::every],
        temperature_c=h.temperature_c[::every],
        base_angles_rad=h.base_angles_rad[::every],
    )
    return replace(run, history=history, outputs=kept, cycle=run.cycle[::every], lines=run.lines[::every])
