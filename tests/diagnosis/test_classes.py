"""Classes of effects that runs cannot distinguish, before any reading, and the run that separates them."""

from __future__ import annotations

import numpy as np
import pytest
from tests.diagnosis.quick import (
    REGISTRY,
    SIGMA,
    blank,
    effect,
    joint,
    make_fitter,
    make_predictor,
    measured,
    pushes,
    ramp,
)

from pliant.diagnosis.candidates import EffectSet
from pliant.diagnosis.classes import (
    EffectClass,
    confounded_classes,
    connected,
    design_runs,
    split_classes,
    unread,
)
from pliant.diagnosis.diagnosis import diagnose, why
from pliant.diagnosis.excitation import ConfoundedPair, excitations
from pliant.diagnosis.next_run import catalogue_view
from pliant.experiments.experiment_catalogue import timed_catalogue
from pliant.experiments.planned_run import BenchScale, named_run
from pliant.report.diagnosis import diagnosis_json

FLAT = joint(gravity=(0, 0, 0))
NARROW = [ramp(f"r{k}", 200.0, 0.5, (3e3, 2e3, 3e3)) for k in range(2)]
KINDS = ["stiffness", "actuation_gain", "sensor_bias", "viscous_damping"]
N = 60.0


def shown(histories, chain=FLAT, kinds=KINDS):
    predictor = make_predictor(chain, blank(histories))
    fitter = make_fitter(predictor)
    return predictor, excitations(REGISTRY, fitter, fitter.fit(EffectSet.from_kinds(REGISTRY, ())), kinds)


def test_classes_are_connected_parts_in_pairs_that_are_alike_both_ways() -> None:
    pairs = [ConfoundedPair(a, b, 0.0) for a, b in ("ab", "ba", "bc", "cb", "cd", "ef", "fe")]
    assert connected("abcdefg", pairs) == (("a", "b", "c"), ("e", "f"))
    assert connected("ab", []) == ()


def test_a_stiffness_and_a_gain_are_one_until_a_load_parts_them() -> None:
    predictor, found = shown(NARROW)
    (together,) = confounded_classes(found, N)
    assert {"stiffness", "actuation_gain"} <= set(together)
    (split,) = split_classes(REGISTRY, catalogue_view(predictor, {"angle_rad": SIGMA}, N), found, N)
    assert split.kinds == together
    assert split.run in ("passive_load_steps", "load_steps", "blocked")
    assert len(split.parts) > 1 and split.minutes > 0.0 and split.words
    _, loaded = shown([*NARROW, pushes("p", 0.0), pushes("q", 6e3)])
    assert not any({"stiffness", "actuation_gain"} <= set(part) for part in confounded_classes(loaded, N))


def test_only_classes_with_an_explanation_that_is_left_look_into_the_menu() -> None:
    predictor, found = shown(NARROW)
    view = catalogue_view(predictor, {"angle_rad": SIGMA}, N)
    (split,) = split_classes(REGISTRY, view, found, N, left=[("viscous_damping",), ()])
    assert split == EffectClass(confounded_classes(found, N)[0], parts=confounded_classes(found, N))


def test_a_diagnosis_says_which_run_splits_its_class() -> None:
    found = diagnose(make_predictor(FLAT, measured(FLAT, NARROW, effect("stiffness"), seed=3)), kinds=KINDS)
    assert found.verdict == "ambiguous"
    (one,) = (one for one in found.classes if "stiffness" in one.kinds)
    (written,) = (entry for entry in diagnosis_json(found)["classes"] if "stiffness" in entry["kinds"])
    assert written["run"] == one.run and written["words"] and written["minutes"] > 0.0
    assert sorted(kind for part in written["parts"] for kind in part) == list(written["kinds"])
    (sentence,) = (line for line in why(found, REGISTRY) if "do not distinguish" in line)
    assert "stiffness" in sentence and f"'{one.run}'" in sentence


def test_a_class_does_not_depend_on_what_was_read() -> None:
    fitter = make_fitter(make_predictor(FLAT, measured(FLAT, NARROW, seed=3)))
    found = excitations(REGISTRY, fitter, fitter.fit(EffectSet.from_kinds(REGISTRY, ())), KINDS)
    assert confounded_classes(found, N) == confounded_classes(shown(NARROW)[1], N)


def test_more_readings_part_more() -> None:
    _, found = shown(NARROW)
    few, many = (sum(map(len, confounded_classes(found, n))) for n in (20.0, 1e5))
    assert many <= few


@pytest.fixture(scope="module")
def designed():
    runs = timed_catalogue(BenchScale.from_chain(FLAT, 15e3))
    predictor = make_predictor(FLAT, unread(runs, ("angle_rad",)))
    kinds = [*KINDS, "thermal_softening", "mullins"]
    return runs, predictor, kinds, design_runs(predictor, runs, kinds)


def test_the_fewest_runs_tell_what_the_whole_menu_tells(designed) -> None:
    runs, _, _, found = designed
    assert list(found.parts) == sorted(set(found.parts))  # every run separates something
    assert len(found.chosen) < len(runs)
    assert "warm" in {runs[k].name for k in found.chosen}  # no other effect softens with temperature
    assert not found.not_excited
    assert found.snr["thermal_softening"][[run.name for run in runs].index("slow_cycles")] == pytest.approx(
        0.0, abs=1e-9
    )
    assert found.minutes == pytest.approx(sum(runs[k].minutes for k in found.chosen))


def test_a_design_keeps_to_its_minutes(designed) -> None:
    runs, predictor, kinds, _ = designed
    found = design_runs(predictor, runs, kinds, most_runs=2, minutes=9.0)
    assert 0 < len(found.chosen) <= 2
    assert found.minutes <= 9.0
    assert "thermal_softening" in found.not_excited


def test_runs_without_a_load_leave_stiffness_and_gain_together(designed) -> None:
    runs, predictor, _, _ = designed
    poor = [named_run(runs, name) for name in ("slow_cycles", "fast_cycles")]
    found = design_runs(predictor, poor, ["stiffness", "actuation_gain", "viscous_damping"])
    assert found.chosen
    assert np.isfinite([value for values in found.snr.values() for value in values]).all()
    assert "viscous_damping" not in {kind for part in found.together for kind in part}
