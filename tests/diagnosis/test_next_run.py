"""The next run: its expected information, the effects that it separates, and cases in which no run helps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.diagnosis.quick import (
    REGISTRY,
    SIGMA,
    P,
    blank,
    effect,
    joint,
    make_fitter,
    make_predictor,
    measured,
    poor,
    pushes,
    ramp,
)

from pliant.diagnosis.candidates import EffectSet
from pliant.diagnosis.catalogue_view import CatalogueView
from pliant.diagnosis.evidence_table import UNKNOWN
from pliant.diagnosis.next_run import (
    Belief,
    NextRun,
    catalogue_view,
    done_before,
    next_run,
    next_runs,
    repeating,
    run_that_excites,
    what_next,
)
from pliant.experiments.planned_run import PlannedRun, named_run
from pliant.report.fitted import next_run_json

FLAT = joint(gravity=(0, 0, 0))
NARROW = [ramp("a", 200.0, 0.5, (3e3, 2e3, 3e3)), ramp("b", 200.0, 0.5, (3e3, 2e3, 3e3))]
SCALES = {"angle_rad": SIGMA}
N = 60.0


def make_belief(histories, hidden: str, *kinds: str, probability=None, chain=FLAT):
    """Return the model under these runs, and hypotheses fitted to data with the hidden effect."""
    predictor = make_predictor(chain, measured(chain, histories, effect(hidden), seed=2))
    fitter = make_fitter(predictor)
    sets = [(kind,) if kind else () for kind in kinds]
    fits = {one: fitter.fit(EffectSet.from_kinds(REGISTRY, one)) for one in sets}
    shares = dict.fromkeys(fits, 1.0 / len(fits)) if probability is None else probability
    return predictor, Belief(fits, shares, N, 1.0)


def test_a_stiffness_is_parted_from_a_gain_by_a_load_without_pressure() -> None:
    predictor, belief = make_belief(NARROW, "stiffness", "stiffness", "actuation_gain")
    view = catalogue_view(predictor, SCALES, N)
    found = next_run(view, belief)
    assert found is not None
    assert "load" in named_run(view.runs, found.name).name or found.name == "blocked"
    assert found.separates == ((("stiffness",), ("actuation_gain",)),)
    assert found.expected > 0.8
    told = [one.gain_per_minute * one.minutes for one in found.ranked]
    enough = [
        one.gain_per_minute for one, nats in zip(found.ranked, told, strict=True) if nats >= 0.5 * max(told)
    ]
    assert found.ranked[0].gain_per_minute == max(enough)
    by_name = {one.name: one for one in found.ranked}
    assert by_name["slow_cycles"].gain_per_minute < 0.5 * found.ranked[0].gain_per_minute
    said = next_run_json(found, "next_run.csv")
    assert said is not None
    assert {"run", "why", "separates", "minutes", "name", "expected", "ranked", "file"} == set(said)


def test_a_run_that_was_done_has_nothing_to_tell_twice() -> None:
    predictor, belief = make_belief(NARROW, "stiffness", "stiffness", "actuation_gain")
    two = next_runs(catalogue_view(predictor, SCALES, N), belief, 2)
    assert len({run.name for run in two}) == len(two)
    for run in two:  # a probability of 10 % alone is no answer
        assert ("more runs will be needed" in run.why) == (run.expected < 0.5)
    if len(two) == 2:
        assert two[1].ranked[0].gain_per_minute < two[0].ranked[0].gain_per_minute


def test_runs_that_were_done_are_the_last_to_be_proposed() -> None:
    predictor, belief = make_belief(NARROW, "stiffness", "stiffness", "actuation_gain")
    view = catalogue_view(predictor, SCALES, N)
    first = next_run(view, belief)
    assert first is not None and first.planned is not None
    histories = [*NARROW, first.planned.history.with_(run="done")]
    done = done_before(view, blank(histories))
    assert [view.runs[k].name for k in done] == [first.name]
    assert done_before(view, predictor.measurement) == ()
    second = next_run(view, belief, done)
    assert second is not None and second.name != first.name
    assert second.ranked[-1].name == first.name


def test_runs_that_do_not_fit_into_the_minutes_are_left_out() -> None:
    predictor, belief = make_belief(NARROW, "stiffness", "stiffness", "actuation_gain")
    found = next_runs(catalogue_view(predictor, SCALES, N), belief, 3, minutes=6.0)
    assert 0.0 < sum(run.minutes for run in found) <= 6.0


def test_one_explanation_needs_no_run() -> None:
    probability = {("stiffness",): 0.99, UNKNOWN: 0.01}
    predictor, belief = make_belief(poor(), "stiffness", "stiffness", probability=probability)
    assert what_next(
        catalogue_view(predictor, SCALES, N), belief, "missing_effect", predictor.measurement
    ) == (
        None,
        "",
    )


def test_a_menu_without_a_run_that_could_decide_says_so() -> None:
    """Turning a weightless finger adds no information, and the sensor is too coarse for the rest."""
    predictor, belief = make_belief(NARROW, "stiffness", "stiffness", "actuation_gain")
    every = catalogue_view(predictor, SCALES, N).runs
    helpless = [named_run(every, name) for name in ("level", "upside_down", "sideways")]
    tired = catalogue_view(
        predictor, {"angle_rad": 100.0}, N, helpless
    )  # readings as coarse as a hundred radians
    found, sentence = what_next(tired, belief, "ambiguous", predictor.measurement)
    assert found is None
    assert "No run of the menu would decide" in sentence
    assert "stiffness and actuation_gain" in sentence
    assert "protocols" in sentence


def test_a_bench_that_does_not_repeat_is_asked_to_repeat() -> None:
    predictor, belief = make_belief(NARROW, "stiffness", "stiffness", "actuation_gain")
    found, sentence = what_next(
        catalogue_view(predictor, SCALES, N), belief, "not_repeatable", predictor.measurement
    )
    assert isinstance(found, NextRun) and "again" in found.run and sentence == ""
    assert found == repeating(predictor.measurement)


def test_only_a_new_specimen_is_virgin() -> None:
    """A measured specimen has softened up to its largest amplitude; a new one only up to the first cycle's."""
    predictor = make_predictor(FLAT, measured(FLAT, poor()))
    view = catalogue_view(predictor, SCALES, N)
    assert [run.name for run in view.runs if run.new_specimen] == ["virgin"]
    virgin = next(k for k, run in enumerate(view.runs) if run.new_specimen)
    used = named_run(view.runs, "virgin")
    used = replace(used, history=used.history.with_(specimen="A"))
    again = catalogue_view(predictor, SCALES, N, [used])
    softening = EffectSet.from_kinds(REGISTRY, ("mullins",))
    fresh = view.evaluate(softening, softening.starts()[0]).values[view.rows([virgin])]
    worn = again.evaluate(softening, softening.starts()[0]).values
    first = slice(0, 40)  # the small first cycle
    assert np.abs(fresh[first] - worn[first]).max() > 1.0
    np.testing.assert_allclose(fresh[-40:], worn[-40:], atol=0.5)  # the last one is the largest for both


def test_the_run_that_shows_an_effect_most_is_named() -> None:
    predictor = make_predictor(FLAT, measured(FLAT, poor()))
    found = run_that_excites(
        catalogue_view(predictor, SCALES, N), {"thermal_softening": [effect("thermal_softening")]}
    )
    assert "warmer" in found["thermal_softening"]


def test_a_second_sensor_counts_where_it_tells_more() -> None:
    """A bias of the angle sensor and a set of the body give equal angles; the tip position depends on the body only."""
    chain = joint()
    predictor, belief = make_belief(
        [ramp("a", 500.0, 1.0), pushes("b", 0.0)], "sensor_bias", "sensor_bias", "", chain=chain
    )
    view = catalogue_view(predictor, SCALES, N)
    assert set(view.added) == {"tip_x_m", "tip_y_m", "tip_z_m"}
    second = [k for k, run in enumerate(view.runs) if run.adds]
    assert view.rows(second).sum() == 4 * len(view.runs[second[0]].history)
    assert np.all(view.worth > 0.0) and np.all(view.worth <= 1.0)
    assert next_run(view, belief) is not None


@pytest.mark.parametrize("n", [5.0, 40.0])
def test_new_readings_are_worth_what_old_ones_are(n: float) -> None:
    predictor, _ = make_belief(NARROW, "stiffness", "stiffness")
    view = catalogue_view(predictor, SCALES, n)
    seconds = sum(float(np.ptp(run.history.time_s)) for run in predictor.measurement.runs)
    slow = [k for k, run in enumerate(view.runs) if run.name == "slow_cycles"]
    assert view.worth[view.rows(slow)].sum() == pytest.approx(n * 161.0 / seconds, rel=0.01)


def test_a_planned_run_continues_the_memory_of_its_specimen() -> None:
    """Loads of both signs have set the specimen; the same run once more is predicted as its repeat."""
    first, again = pushes("first", 0.6 * P), pushes("again", 0.6 * P)
    hidden = effect("permanent_set")
    predictor = make_predictor(FLAT, measured(FLAT, [first], hidden, seed=2))
    repeats = make_predictor(FLAT, measured(FLAT, [first, again], hidden, seed=2)).predict([hidden])
    virgin, repeat = (one["angle_rad"] for one in repeats)

    def planned(body: str) -> np.ndarray:
        run = PlannedRun("again", "", again.with_(specimen=body), 1.0)
        view = CatalogueView.from_predictor(predictor, [run], SCALES, None)
        candidate = EffectSet.from_kinds(REGISTRY, ("permanent_set",))
        x = np.array([p.x(hidden.share) if p.name.endswith("share") else 0.0 for p in candidate.parameters])
        return -SIGMA * view.evaluate(candidate, x).values

    def distance(one: np.ndarray, other: np.ndarray) -> float:
        return float(min(np.abs(one - other).max(), np.abs(one + other).max()))

    assert distance(virgin, repeat) > 2 * SIGMA
    assert distance(planned("A"), repeat) < 0.1 * distance(virgin, repeat)
