"""The default menu: its scale, its loads, opposed chambers, tendons and extensions."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from tests.diagnosis.quick import blank, joint, make_history, make_measurement, make_predictor, poor, pushes
from tests.mechanics.test_several_actuations import make_chain, several_law

from pliant.config.protocols import OPTIONS
from pliant.diagnosis.next_run import candidate_runs
from pliant.errors import UserError
from pliant.experiments.experiment_catalogue import static_catalogue, timed_catalogue
from pliant.experiments.planned_run import (
    LOAD_OF_PEAK,
    BenchScale,
    corners,
    named_run,
    steps,
    total_effort,
    triangles,
)
from pliant.records.chain import Actuator
from pliant.records.history import History
from pliant_plugins.surrogates.polynomial.several_law import SeveralLaw

CHAIN = joint()
OPPOSED = joint(actuators=[{"input": "pressure_1_pa", "sign": 1}, {"input": "pressure_2_pa", "sign": -1}])


def scaled(histories, chain=CHAIN) -> BenchScale:
    return BenchScale.from_measurement(chain, blank(histories))


def test_the_menu_has_the_names_that_a_study_may_use() -> None:
    assert [run.name for run in timed_catalogue(scaled(poor()))] == [
        name for name in OPTIONS if name not in ("custom", "each_input", "paid_out")
    ]


def test_runs_start_unloaded_increase_in_time_and_stay_within_the_measured_range() -> None:
    for run in timed_catalogue(scaled(poor())):
        history = run.history
        assert history.time_s is not None
        assert history.time_s[0] == 0.0
        assert np.all(np.diff(history.time_s) > 0.0), run.name
        assert history.actuation["pressure_pa"].min() >= 0.0
        assert history.actuation["pressure_pa"].max() <= 15e3 * (1 + 1e-12)
        assert run.minutes == pytest.approx(run.motion_minutes + (run.minutes - run.motion_minutes))
        assert run.minutes >= run.motion_minutes + 1.9
        assert run.words


def test_loads_equal_the_measurement_or_a_share_in_the_law_torque() -> None:
    measured = scaled([*poor(), pushes("p", 0.0, moment=4e-3)])
    assert named_run(
        timed_catalogue(measured), "passive_load_steps"
    ).history.moment_n_m.min() == pytest.approx(-4e-3)
    stated = named_run(timed_catalogue(scaled(poor())), "load_steps").history
    peak = total_effort(CHAIN, {"pressure_pa": np.array([15e3])})[0]
    assert stated.moment_n_m.max() == pytest.approx(LOAD_OF_PEAK * peak)
    assert not named_run(timed_catalogue(measured), "slow_cycles").history.moment_n_m.any()


def test_blocking_loads_balance_the_drive_at_zero_angle() -> None:
    blocked = named_run(timed_catalogue(scaled(poor())), "blocked").history
    torque = total_effort(CHAIN, blocked.actuation)
    np.testing.assert_allclose(blocked.moment_n_m, torque, rtol=1e-12)
    assert torque.max() > 0.0


def test_a_bench_that_pushed_at_the_tip_is_asked_to_push_there() -> None:
    force = np.array([0.0, 0.0, -0.2])
    pushed = make_history("p", np.arange(10.0), np.full(10, 5e3), tip_force_n=force)
    found = named_run(timed_catalogue(scaled([pushed])), "passive_load_steps").history
    np.testing.assert_allclose(found.tip_force_n[np.argmin(found.tip_force_n[:, 2])], force)
    assert not found.moment_n_m.any()


def test_measurement_conditions_are_kept_but_for_what_a_run_changes() -> None:
    warm = [h.with_(temperature_c=np.full(len(h), 30.0), specimen="B") for h in poor()]
    runs = timed_catalogue(scaled(warm))
    assert named_run(runs, "slow_cycles").history.temperature_c[0] == 30.0
    assert named_run(runs, "warm").history.temperature_c[0] == 45.0
    assert {run.history.specimen for run in runs} == {"B", "new"}
    turned = named_run(runs, "sideways").history.base_angles_rad[0]
    np.testing.assert_allclose(turned, [np.pi / 2, 0.0, 0.0])


def test_opposed_chambers_are_driven_in_turn() -> None:
    run = named_run(timed_catalogue(BenchScale.from_chain(OPPOSED, 15e3)), "slow_cycles").history
    one, two = run.actuation["pressure_1_pa"], run.actuation["pressure_2_pa"]
    assert one.max() == two.max() == pytest.approx(15e3)
    assert not np.any((one > 0) & (two > 0))


def opposing_law() -> SeveralLaw:
    """Return τ = g (p₁ − p₂) − k u, in one law of both pressures."""
    law = several_law()
    terms = np.array([[1, 0, 1], [0, 1, 1], [0, 0, 2]])
    maps = np.array([[0.0, 2e4], [0.0, 2e4], [0.0, 0.3]])
    return dataclasses.replace(law, exponents=terms, coefficients=np.array([-4e-3, 4e-3, 2e-3]), maps=maps)


def test_a_law_with_two_pressures_is_driven_by_each_and_by_both() -> None:
    law = opposing_law()
    chain = make_chain(law, 2, own=[(Actuator("pressure_1_pa"), Actuator("pressure_2_pa"))])
    runs = timed_catalogue(BenchScale.from_chain(chain, 15e3))
    each = named_run(runs, "each_input").history
    one, two = each.actuation["pressure_1_pa"] > 0, each.actuation["pressure_2_pa"] > 0
    assert [np.sum(one & ~two), np.sum(two & ~one), np.sum(one & two)] == [39] * 3
    assert (
        each.actuation["pressure_1_pa"].max() == each.actuation["pressure_2_pa"].max() == pytest.approx(15e3)
    )
    cycles = named_run(runs, "slow_cycles").history  # both at once would not bend the joint
    one, two = cycles.actuation["pressure_1_pa"], cycles.actuation["pressure_2_pa"]
    assert one.max() == two.max() == pytest.approx(15e3)
    assert not np.any((one > 0) & (two > 0))
    blocked = named_run(runs, "blocked").history
    levels = np.column_stack([blocked.actuation["pressure_1_pa"], blocked.actuation["pressure_2_pa"]])
    wanted = law.evaluate(levels, np.zeros((len(levels), 1))).tau[:, 0]
    np.testing.assert_allclose(blocked.moment_n_m, wanted, atol=1e-12)
    assert np.abs(wanted).max() > 1e-3


def test_a_chamber_that_the_bench_never_drove_stays_vented() -> None:
    runs = [
        h.with_(actuation={"pressure_1_pa": np.zeros(len(h)), "pressure_2_pa": h.actuation["pressure_pa"]})
        for h in poor()
    ]
    for run in timed_catalogue(scaled(runs, OPPOSED)):
        assert not run.history.actuation["pressure_1_pa"].any()
        assert run.history.actuation["pressure_2_pa"].max() == pytest.approx(
            0.0 if run.name == "passive_load_steps" else 15e3 * (0.6 if run.name == "load_steps" else 1.0)
        )


def test_a_tendon_has_no_valve() -> None:
    chain = joint().with_(actuators=(Actuator("tendon_force_n"),))
    runs = timed_catalogue(BenchScale.from_chain(chain, 9.0))
    assert "closed_valve" not in {run.name for run in runs}
    assert named_run(runs, "holds").history.actuation["tendon_force_n"].max() == pytest.approx(9.0)
    assert "pressure" not in named_run(runs, "load_steps").words


def test_a_second_sensor_reads_the_tip_and_every_joint() -> None:
    run = named_run(timed_catalogue(BenchScale.from_chain(joint(3), 15e3)), "second_sensor")
    assert run.adds == ("tip_x_m", "tip_y_m", "tip_z_m", *(f"joint_{k}_angle_rad" for k in (1, 2, 3)))


def test_without_a_domain_nobody_knows_how_far_to_drive() -> None:
    assert timed_catalogue(BenchScale.from_chain(CHAIN, 15e3))
    with pytest.raises(UserError, match="states no domain"):
        BenchScale.from_chain(CHAIN)


def test_a_run_that_is_not_there_names_the_closest() -> None:
    with pytest.raises(UserError, match="did you mean 'slow_cycles'"):
        named_run(timed_catalogue(scaled(poor())), "slow_cycle")


def test_waves_pass_through_their_corners() -> None:
    wave = triangles(20.0, [1.0, 0.5], 0.5)
    assert wave.share[20] == 1.0 and wave.share[40] == 0.0 and wave.share[60] == 0.5 and wave.seconds == 40.0
    held = steps((0.4, 1.0), 10.0, 0.5)
    assert (
        held.share[-1] == 1.0 and held.share[19] == pytest.approx(0.4) and held.share[1] == pytest.approx(0.2)
    )
    assert corners([(0.0, 0.0), (2.0, 1.0)], 0.5).share.tolist() == [0.0, 0.25, 0.5, 0.75, 1.0]


# -- a bench that recorded no time --------------------------------------------------------------------

SCALE = BenchScale.from_chain(CHAIN, 15e3)
TIMED = ("slow_cycles", "fast_cycles", "small_loops", "holds", "vented_zero", "closed_valve", "step_response")


def test_no_run_depends_on_time():
    runs = static_catalogue(SCALE)
    assert not {run.name for run in runs} & set(TIMED)
    assert all(run.history.time_s is None and run.motion_minutes == 0.0 for run in runs)
    assert all(run.minutes >= 2.0 for run in runs)
    assert not any(word in run.words for run in runs for word in ("cycle", "Hz", " s ", "hold"))


def test_loads_and_the_drive_reach_as_far_as_the_bench_did():
    passive, loaded = (
        named_run(static_catalogue(SCALE), name).history for name in ("passive_load_steps", "load_steps")
    )
    assert not passive.actuation["pressure_pa"].any()
    assert passive.moment_n_m.max() == -passive.moment_n_m.min() == pytest.approx(SCALE.load[0])
    assert np.ptp(loaded.actuation["pressure_pa"]) == 0.0 < loaded.actuation["pressure_pa"][0]
    assert named_run(static_catalogue(SCALE), "level").history.actuation["pressure_pa"].max() == 15e3


def test_the_blocking_load_is_the_drives_torque():
    history = named_run(static_catalogue(SCALE), "blocked").history
    torque = SCALE.blocking_moment(history.actuation)
    assert torque is not None
    assert np.allclose(history.moment_n_m, torque)
    assert history.moment_n_m[-1] > 0.0 == history.moment_n_m[0]


def test_opposed_chambers_are_driven_both_ways():
    history = named_run(static_catalogue(BenchScale.from_chain(OPPOSED, 15e3)), "level").history
    assert all(values.max() == 15e3 for values in history.actuation.values())
    assert len(history) == 9


def test_states_without_a_clock_are_followed_by_states_without_a_clock():
    """The runs that `diagnose` proposes have a clock exactly if the measured ones have."""
    for clock in (None, np.arange(5.0)):
        history = History.from_arrays({"pressure_pa": 3e3 * np.arange(5.0)}, clock, run="a")
        measured = make_measurement([history], [{"angle_rad": np.zeros(5)}])
        timed = [
            run for run in candidate_runs(make_predictor(CHAIN, measured)) if run.history.time_s is not None
        ]
        assert bool(timed) == (clock is not None)
