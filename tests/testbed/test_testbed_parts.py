"""Parts of the test bed's truths: valves, bars, interfaces, turned frames, tendons, walls and sensors."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks.evidence.forms import Forms
from benchmarks.evidence.protocols import LOAD_N_M, steps
from benchmarks.evidence.robots import (
    B_E,
    GRAVITY_M_S2,
    JOINT,
    M_A,
    M_E,
    PRESSURE_MAX_PA,
    ROBOTS,
)
from benchmarks.evidence.sensors import Sensor, averaged, late, play, sensed
from benchmarks.evidence.sets import (
    ENGINES,
)
from benchmarks.evidence.skeleton import Body, base_turn, readings, skeleton, tips, turn
from benchmarks.evidence.truths import Truth
from scipy.optimize import brentq
from tests.testbed.test_testbed_truth import (
    ALL,
    BOTH,
    angles,
    make_run,
)


@pytest.mark.parametrize("engine", ALL)
def test_a_closed_valve_keeps_the_pressure_and_a_leak_lets_it_go(engine: str) -> None:
    n, closed = 150, slice(50, 100)
    valve = np.ones(n)
    valve[closed] = 0.0
    pressure = PRESSURE_MAX_PA * np.where(np.arange(n) < 60, np.minimum(1.0, np.arange(n) / 20), 0.2)
    run = make_run(pressure, valve_open=valve)
    (tight,) = angles(engine, Truth(), run)
    assert np.ptp(tight[closed]) < 1e-3 < tight[45] - tight[-1]  # a command meanwhile has no effect
    (leaky,) = angles(engine, Truth(Forms(leak_1_s=0.02, leak_power=0.5, leak_filling_s=0.0)), run)
    assert leaky[:50] == pytest.approx(tight[:50], abs=1e-6)
    # dp/dt = −λ √(p₀ p) from p₀: √p falls along a straight line, to (1 − λ t / 2)² after t.
    left = PRESSURE_MAX_PA * (1 - 0.02 * 0.4 * 49.5 / 2) ** 2
    (held,) = angles(engine, Truth(), make_run(np.full(40, left)))
    assert leaky[99] == pytest.approx(held[-1], abs=2e-3)


def test_a_joint_with_a_crossbar_rings_at_its_frequency_in_every_engine() -> None:
    bar, n = 1.5e-4, 150
    clock = 0.02 * np.arange(n)
    pressure = PRESSURE_MAX_PA * np.minimum(0.5, np.arange(n) / 20)
    load = 1e-3 * (np.arange(n) < 60)  # a small load is released
    found = {}
    for engine in ALL:
        truth = Truth(body=Body(crossbar_kg_m2=bar))
        (angle,) = angles(engine, truth, make_run(pressure, load, time_s=clock))
        rest = angle[100:]
        crossings = np.flatnonzero(np.diff(np.sign(rest - rest.mean())))
        found[engine] = np.pi * (len(crossings) - 1) / (clock[crossings[-1]] - clock[crossings[0]])
        level = rest.mean()
    stiffness = B_E + M_E * level - M_A * PRESSURE_MAX_PA / 2
    stiffness += JOINT.mass_kg / 2 * GRAVITY_M_S2 * JOINT.length_m / 4 * np.cos(level)
    inertia = bar + JOINT.mass_kg / 2 * (JOINT.length_m / 2) ** 2 / 3
    for engine, frequency in found.items():
        assert frequency == pytest.approx(np.sqrt(stiffness / inertia), rel=0.06), engine


def test_interfaces_are_springs_in_series_and_turn_about_the_modules_axis() -> None:
    robot = ROBOTS["four"]
    n = 20
    weightless = make_run(np.zeros(n), np.full(n, 1e-3), base_angles_rad=(np.pi / 2, 0.0, 0.0))
    truth = Truth(body=Body(interface=0.3))
    bones = skeleton(robot, truth.body)
    assert list(bones.module) == [0, -1, 1, -1, 2, -1, 3]
    assert bones.masses_kg.sum() == pytest.approx(robot.mass_kg * 3.5)
    (followed,) = ENGINES["functional"].follow(robot, (weightless,), truth)
    connections = followed[-1, bones.module < 0]
    assert connections == pytest.approx(-1e-3 * 0.3 / B_E, abs=1e-6)
    seen = readings(robot, followed, body=truth.body)
    each = sum(seen[f"joint_{k}_angle_rad"] for k in (1, 2, 3, 4))
    assert each == pytest.approx(seen["angle_rad"])


def test_turned_axes_leave_the_plane_by_their_turn() -> None:
    robot, angle = ROBOTS["four"], 0.2
    straight, turned = Body(), Body(twist_rad=angle)
    u = np.full((1, 4), 0.3)
    plain, other = (tips(skeleton(robot, body), u, np.eye(3))[0] for body in (straight, turned))
    assert other == pytest.approx(turn(np.array([0, 0, angle])) @ plain)


def test_pieces_lengthen_with_the_pressure_and_angles_stay() -> None:
    robot, share = ROBOTS["four"], np.array([0.0, 0.5, 1.0])
    straight = np.zeros((3, 4))
    even = readings(robot, straight, body=Body(stretch=0.05, stretch_power=2.0), share=share)
    assert even["tip_z_m"] == pytest.approx(-4 * robot.length_m * (1 + 0.05 * share**2))
    bent = np.full((3, 4), 0.3)
    longer = Body(stretch=0.05, stretch_saturating=1.0, stretch_taper=0.2)
    plain, found = readings(robot, bent), readings(robot, bent, body=longer, share=share)
    assert found["angle_rad"] == pytest.approx(plain["angle_rad"])
    assert [found[f"tip_{a}_m"][0] for a in "xz"] == pytest.approx([plain[f"tip_{a}_m"][0] for a in "xz"])
    assert abs(found["tip_x_m"][2]) > 1.04 * abs(plain["tip_x_m"][2])


@pytest.mark.parametrize("engine", BOTH)
def test_held_ends_bend_less_and_the_middle_as_before(engine: str) -> None:
    robot, run = ROBOTS["finger"], make_run(PRESSURE_MAX_PA * np.minimum(1, np.arange(60) / 20))
    horizontal = make_run(run.pressure_pa, base_angles_rad=(np.pi / 2, 0.0, 0.0))  # no weight in the plane
    for forms in (Forms(end_base=0.1, end_cap=0.2), Forms(end_base=0.1, end_cap=0.2, end_giving=0.3)):
        plain, held = (
            ENGINES[engine].follow(robot, (horizontal,), Truth(f))[0][-1] for f in (Forms(), forms)
        )
        lost = 1 - held / plain
        assert lost[1] == pytest.approx(0.0, abs=1e-4) and 0.02 < lost[0] < lost[2] < 0.2


def test_the_base_turns_about_world_axes_in_their_order() -> None:
    about_x_then_y = base_turn((np.pi / 2, np.pi / 2, 0.0), Body())
    assert about_x_then_y @ np.array([0, 0, 1.0]) == pytest.approx([0, -1, 0], abs=1e-12)
    assert about_x_then_y @ np.array([0, 1.0, 0]) == pytest.approx([1, 0, 0], abs=1e-12)


@pytest.mark.parametrize("engine", BOTH)
def test_a_rolled_base_takes_the_weight_outside_the_plane(engine: str) -> None:
    load = 0.4 * LOAD_N_M
    (angle,) = angles(engine, Truth(), make_run(np.zeros(20), load, base_angles_rad=(np.pi / 2, 0.0, 0.0)))
    expected = brentq(lambda u: -0.5 * M_E * u * abs(u) - B_E * u - load, -1, 1)
    assert angle[-1] == pytest.approx(expected, abs=2e-6)


def test_a_tendon_pulls_less_behind_a_bend_and_more_when_let_out() -> None:
    n = 200
    wave = PRESSURE_MAX_PA * np.concatenate([np.linspace(0, 1, n), np.linspace(1, 0, n)])
    run, finger = make_run(wave), ROBOTS["finger"]
    free, rough = (
        ENGINES["functional"].follow(finger, (run,), Truth(Forms(tendon=mu)))[0] for mu in (0.0, 0.3)
    )
    change = rough - free
    assert np.all(change[n // 2] < 0) and np.all(change[n + n // 2] > 0)
    assert abs(change[n // 2, 2]) > 1.5 * abs(change[n // 2, 0])  # more wrap


def test_walls_and_bimodulus_change_what_their_names_say() -> None:
    loads = make_run(
        np.zeros(60), LOAD_N_M * steps((1.0, -1.0, 0.0), 8.0), base_angles_rad=(np.pi / 2, 0.0, 0.0)
    )
    (plain,) = angles("functional", Truth(), loads)
    (thick,) = angles("functional", Truth(Forms(wall=1.2)), loads)
    assert abs(thick[15]) < abs(plain[15]) and abs(thick[35]) < abs(plain[35])
    (uneven,) = angles("functional", Truth(Forms(bimodulus=0.3)), loads)
    assert abs(uneven[15]) > abs(plain[15]) and abs(uneven[35]) < abs(plain[35])  # loads oppose the actuation


def test_every_field_in_a_truth_changes_one_record_only() -> None:
    names = [*Forms._fields, *Body.__dataclass_fields__, *Sensor.__dataclass_fields__]
    assert len(names) == len(set(names))


def test_a_moving_average_is_late_by_half_its_window() -> None:
    clock = 0.02 * np.arange(500)
    ramp = 0.1 * clock
    assert sensed(ramp, clock, Sensor(late_s=0.5, late_average=1.0), 0.0)[-1] == pytest.approx(
        ramp[-1] - 0.05
    )
    step = (clock > 4.0).astype(float)
    seen = averaged(step, clock, 1.0)
    assert seen[250] == pytest.approx(1.0, abs=0.02) and seen[225] == pytest.approx(0.5, abs=0.02)


def test_sensors_are_late_dragged_and_scaled() -> None:
    clock = 0.02 * np.arange(500)
    ramp = 0.1 * clock
    lagging = sensed(ramp, clock, Sensor(late_s=0.5, late_second=0.4), 0.0)
    assert lagging[-1] == pytest.approx(ramp[-1] - 0.1 * 0.5 * 1.4, rel=1e-3)
    step = np.concatenate([[0.0], np.ones(len(clock) - 1)])
    assert late(step, clock, 1.0, 1.0)[51] == pytest.approx(1 - np.exp(-1.01), abs=0.01)
    wave = np.concatenate([ramp, ramp[::-1]])
    assert play(wave, 0.1)[499] == pytest.approx(ramp[-1] - 0.05)
    assert play(wave, 0.1)[-1] == pytest.approx(0.05)
    both = sensed(wave, np.arange(1000) * 0.02, Sensor(play_rad=0.1, play_knee=0.5), 0.0)
    assert both[-1] == pytest.approx(0.05)
    assert sensed(np.array([0.4]), np.zeros(1), Sensor(scale=0.1, curvature=0.2), 0.0) == pytest.approx(
        0.4 * 1.11
    )
