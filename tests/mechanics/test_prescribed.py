"""A joint clamped by the bench: the effort along a prescribed path, against closed forms and the engines."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.diagnosis.quick import BENCH, ENGINE, effect

from pliant.errors import UserError
from pliant.evidence.prediction import Predictor
from pliant.experiments.experiment_catalogue import OF_HELD, timed_catalogue
from pliant.experiments.planned_run import BenchScale
from pliant.interfaces.effect import EffectConfig
from pliant.measurements.reading import read_measurement
from pliant.mechanics.prescribed import prescribed_motion
from pliant.records.chain import ChainModel
from pliant.records.history import History
from pliant.records.measurement import MeasuredRun, Measurement
from pliant.testing.samples import linear_law, linear_prismatic_law, sample_chain

STRIP = sample_chain(linear_prismatic_law(), modules=1, gravity=(0, 0, 0))
HINGE = sample_chain(linear_law(), modules=1, gravity=(0, 0, 0))
STIFFNESS_N_M, LENGTH_M = 400.0, STRIP.length_m


def blocked(chain: ChainModel, histories: list[History], *effects: EffectConfig) -> list[np.ndarray]:
    """Return the predicted reading in each run, under the chain with these effects."""
    name = "blocked_force_n" if chain is STRIP else "blocked_moment_n_m"
    runs = tuple(
        MeasuredRun(h, {name: np.zeros(len(h))}, {}, np.ones(len(h)), np.zeros(0)) for h in histories
    )
    predictor = Predictor(BENCH, ENGINE, chain, Measurement(runs, (name,), "bench.csv"))
    return [run[name] for run in predictor.predict(effects)]


def stretched(time: np.ndarray, strain: np.ndarray, run: str = "a") -> History:
    return History.from_arrays({"held_elongation_strain": strain}, time, run=run)


def test_without_memory_it_is_the_law() -> None:
    strain = np.array([0.0, 0.1, -0.2])
    pressed = History.from_arrays(
        {"held_elongation_strain": strain, "pressure_pa": [0.0, 1e4, 2e4]}, [0.0, 1.0, 2.0]
    )
    want = -STIFFNESS_N_M * LENGTH_M * strain + 2e-5 * np.array([0.0, 1e4, 2e4])
    np.testing.assert_allclose(blocked(STRIP, [pressed])[0], want, atol=1e-12)


def test_stress_relaxes_as_the_branch_says() -> None:
    time = np.array([0.0, 0.1, 0.6, 3.1, 10.0, 40.0])
    strain = np.array([0.0, 0.5, 0.5, 0.5, 0.5, 0.5])
    force = blocked(STRIP, [stretched(time, strain)], effect("viscoelastic", share=0.3, time_s=5.0))[0]
    relaxed = -STIFFNESS_N_M * LENGTH_M * 0.5
    surplus = force[1:] / relaxed - 1.0
    np.testing.assert_allclose(surplus / surplus[0], np.exp(-(time[1:] - 0.1) / 5.0), rtol=1e-9)
    assert surplus[0] == pytest.approx(0.3 * 50 * (1 - np.exp(-0.02)), rel=1e-9)  # evenly over 0.1 s


@pytest.mark.parametrize("kind", ["viscoelastic", "friction_hysteresis", "mullins", "permanent_set"])
def test_the_engine_finds_the_angle_again_under_the_moment_that_was_read(kind: str) -> None:
    time = np.linspace(0.0, 12.0, 121)
    angle = 0.4 * np.sin(time) * np.minimum(time / 4, 1)
    pressure = 2e3 * np.sin(0.7 * time) ** 2
    held = History.from_arrays({"held_angle_rad": angle, "pressure_pa": pressure}, time)
    moment = blocked(HINGE, [held], effect(kind))[0]
    free = History.from_arrays({"pressure_pa": pressure}, time, moment_n_m=moment)
    runs = (MeasuredRun(free, {"angle_rad": angle}, {}, np.ones(len(free)), np.zeros(0)),)
    predictor = Predictor(BENCH, ENGINE, HINGE, Measurement(runs, ("angle_rad",), "bench.csv"))
    np.testing.assert_allclose(predictor.predict([effect(kind)])[0]["angle_rad"], angle, atol=2e-6)


def test_damage_continues_in_the_next_run_on_the_specimen() -> None:
    time = np.linspace(0.0, 2.0, 21)
    up = stretched(time, 0.8 * np.minimum(time, 1.0), "first")
    softer = effect("mullins", softening=0.3, scale_rad=0.05)
    first, second = blocked(STRIP, [up, up.with_(run="second")], softer)
    fresh = blocked(STRIP, [up, up.with_(run="other", specimen="B")], softer)[1]
    np.testing.assert_array_equal(first, fresh)
    assert np.all(np.abs(second[1:10]) < np.abs(first[1:10]))


def test_slopes_match_the_readings() -> None:
    time = np.linspace(0.0, 5.0, 51)
    history = stretched(time, 0.1 * time)
    runs = (MeasuredRun(history, {"blocked_force_n": time}, {}, np.ones(51), np.zeros(0)),)
    predictor = Predictor(BENCH, ENGINE, STRIP, Measurement(runs, ("blocked_force_n",), "bench.csv"))
    at, there = effect("stiffness", factor=1.0), effect("stiffness", factor=1.5)
    base, (change,) = predictor.vary([at], [[there]])
    np.testing.assert_allclose(
        change[0]["blocked_force_n"], 0.5 * base.runs[0]["blocked_force_n"], atol=1e-12
    )


def test_a_file_without_supply_is_read(tmp_path: Path) -> None:
    path = tmp_path / "strip.csv"
    path.write_text("run,time_s,held_elongation_strain,blocked_force_n\na,0,0,0\na,1,0.1,-3\na,2,0.2,-5\n")
    found = read_measurement(path, actuation=("pressure_pa",))
    np.testing.assert_array_equal(found.runs[0].history.actuation["held_elongation_strain"], [0, 0.1, 0.2])
    predictor = Predictor(BENCH, ENGINE, STRIP, found)
    assert predictor.predict()[0]["blocked_force_n"][1] == pytest.approx(-40.0 * LENGTH_M)


def test_the_menu_for_a_held_joint_moves_it_and_loads_nothing() -> None:
    time = np.linspace(0.0, 5.0, 51)
    history = stretched(time, 0.1 * time)
    run = MeasuredRun(history, {"blocked_force_n": time}, {}, np.ones(51), np.zeros(0))
    scale = BenchScale.from_measurement(STRIP, Measurement((run,), ("blocked_force_n",), "bench.csv"))
    assert {one.name for one in timed_catalogue(scale)} == set(OF_HELD)
    for one in timed_catalogue(scale):
        assert one.history.actuation["held_elongation_strain"].max() == pytest.approx(0.5)
        assert not one.history.tip_force_n.any()


def test_what_cannot_be_held_is_refused() -> None:
    time = np.linspace(0.0, 1.0, 3)
    with pytest.raises(UserError, match="held in all runs"):
        prescribed_motion(
            STRIP, [stretched(time, time), History.from_arrays({"pressure_pa": time}, time, run="free")]
        )
    several = sample_chain(linear_law(), modules=2)
    with pytest.raises(UserError, match="hold one joint, and this chain has 2"):
        prescribed_motion(several, [History.from_arrays({"held_angle_rad": time}, time)])
