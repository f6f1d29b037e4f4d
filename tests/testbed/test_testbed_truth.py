"""The truths of the hidden-effect test bed behave as the physics that they are named after."""

from __future__ import annotations

import csv
import io
from functools import cache
from typing import Any

import numpy as np
import pytest
from benchmarks.evidence import mujoco_truth
from benchmarks.evidence.forms import DEAD_TIME, SECOND_ORDER, Forms, arriving, stretched
from benchmarks.evidence.protocols import LOAD_N_M, NAMES, Run, protocol, steps, triangles
from benchmarks.evidence.robots import (
    B_E,
    CHAIN,
    GRAVITY_M_S2,
    JOINT,
    K_N,
    M_A,
    M_E,
    PRESSURE_MAX_PA,
    ROBOTS,
    TIPS,
    Array,
)
from benchmarks.evidence.sets import (
    ENGINES,
    SIGMA_OF_RANGE,
    SPECTRA,
    MeasuredSet,
    SetSpec,
    draw_noise,
    follow,
    make_set,
    noise_sizes,
    signal,
)
from benchmarks.evidence.skeleton import Body, readings
from benchmarks.evidence.truths import CLEAN, KINDS, UNKNOWN, Truth, draw, kind_robots
from scipy.optimize import brentq
from tests.slow import slow_among

from pliant.config.loading import load_study
from pliant.registry.discovery import discover

BOTH = ("functional", "mujoco")
ALL = (*BOTH, "explicit")
SIGMA_RAD = 0.01
END = -13  # the last 5 s


def make_run(pressure: Array, moment: float | Array = 0.0, specimen: str = "A", **conditions: float) -> Run:
    return Run("test", specimen, pressure, np.broadcast_to(moment, len(pressure)).copy(), **conditions)


def angles(engine: str, truth: Truth, *runs: Run) -> list[Array]:
    """Return the (t,) angle of one joint in every run."""
    return [run[:, 0] for run in ENGINES[engine].follow(JOINT, runs, truth)]


def change(engine: str, truth: Truth, *runs: Run) -> list[Array]:
    """Return the change of the angles by the truth, in rad."""
    pairs = zip(angles(engine, truth, *runs), angles(engine, Truth(), *runs), strict=True)
    return [one - other for one, other in pairs]


def loop_area(pressure: Array, angle: Array, samples: int) -> float:
    """Return ∮ u dp over the last cycle of `samples`, rad·Pa: positive where unloading is above loading."""
    p, u = (np.append(values[-samples:], values[-samples]) for values in (pressure, angle))
    return float(-np.sum(np.diff(p) * (u[1:] + u[:-1]) / 2))


def test_worked_number_in_the_contract() -> None:
    read = readings(CHAIN, np.full((1, 8), 0.359718))
    assert read["tip_x_m"][0] == pytest.approx(0.059451, abs=1e-6)
    assert read["tip_z_m"][0] == pytest.approx(-0.007889, abs=1e-6)
    pitched = readings(CHAIN, np.zeros((1, 8)), (0.0, np.pi / 2, 0.0))
    assert [pitched[name][0] for name in TIPS] == pytest.approx([-0.088, 0, 0], abs=1e-12)
    rolled = readings(CHAIN, np.zeros((1, 8)), (np.pi / 2, 0.0, 0.0))
    assert [rolled[name][0] for name in TIPS] == pytest.approx([0, 0.088, 0], abs=1e-12)


@pytest.mark.parametrize("engine", slow_among(ALL, *(set(ALL) - {"explicit"})))
@pytest.mark.parametrize("pitch", [0.0, np.pi / 2])
def test_a_held_joint_stands_where_its_moments_balance(engine: str, pitch: float) -> None:
    load, p = 0.5 * LOAD_N_M, 0.7 * PRESSURE_MAX_PA

    def balance(u: float) -> float:
        law = K_N * p + M_A * p * u - 0.5 * M_E * u * abs(u) - B_E * u
        weight = JOINT.mass_kg / 2 * GRAVITY_M_S2 * JOINT.length_m / 4 * np.sin(u - pitch)
        return law - load - weight

    (angle,) = angles(engine, Truth(), make_run(p * np.ones(20), load, base_angles_rad=(0.0, pitch, 0.0)))
    assert angle[-1] == pytest.approx(brentq(balance, -1, 2), abs=2e-6)


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(ROBOTS))
def test_the_engines_agree_on_the_clean_truth(name: str) -> None:
    robot = ROBOTS[name]
    runs = protocol("example", robot)
    engines = ALL if name == "joint" else BOTH
    found = {engine: follow(engine, robot, runs, Truth(), np.zeros(len(runs))) for engine in engines}
    sigma = noise_sizes(found["functional"])
    for engine in found:
        assert signal(found["functional"], found[engine], sigma) < 0.1, engine


@cache
def made(kind: str, robot: str = "", **more: Any) -> MeasuredSet:
    said = {"snr": 2.0, **more}
    return make_set(SetSpec(kind, 3, robot=robot or kind_robots(kind)[0], **said))


# The poor protocol shows all but these.
RICH = ("thermal_softening", "leak", "inertia", "warm_stick", "session_drift", "load_coupling", "warm_sensor")
CASES = [
    (kind, "functional", 0.8 if kind == "inertia" else 2.0, "rich" if kind in RICH else "poor")
    for kind in (*KINDS, *UNKNOWN)
]


@pytest.mark.slow
@pytest.mark.parametrize(
    "kind, engine, snr, protocol", [*CASES, ("friction_hysteresis", "mujoco", 1.5, "rates")]
)
def test_every_effect_reaches_the_strength_that_was_asked_for(
    kind: str, engine: str, snr: float, protocol: str
) -> None:
    found = made(kind, engine=engine, snr=snr, protocol=protocol)
    assert signal(found.clean, found.hidden, found.sigma) == pytest.approx(snr, rel=0.1)
    assert found.label["excited"] and found.label["snr_reached"] == pytest.approx(snr, rel=0.1)


def test_strength_is_the_root_mean_square_over_all_readings() -> None:
    found = made("stiffness", "chain", protocol="rates")
    squares = []
    for name, sigma in found.sigma.items():
        for hidden, clean in zip(found.hidden, found.clean, strict=True):
            squares += list(((hidden[name] - clean[name]) / sigma) ** 2)
    assert len(found.sigma) == 4 and np.sqrt(np.mean(squares)) == pytest.approx(2.0, rel=0.1)


def test_a_second_sensor_is_read_in_its_own_runs_only() -> None:
    found, runs = made("sensor_scale"), protocol("rich")
    for run, read in zip(runs, found.hidden, strict=True):
        assert set(read) == {"angle_rad", *(TIPS if run.second else ())}
    ranges = [np.ptp(read["tip_x_m"]) for read in found.clean if "tip_x_m" in read]
    assert found.sigma["tip_y_m"] == pytest.approx(SIGMA_OF_RANGE * max(ranges), rel=1e-9)
    blank = [row for row in csv.DictReader(io.StringIO(found.csv)) if row["tip_x_m"] == ""]
    assert len(blank) == sum(len(run) for run in runs if not run.second)


def test_an_effect_that_the_runs_do_not_show_is_labelled_so() -> None:
    label = make_set(SetSpec("thermal_softening", 0, protocol="poor")).label
    assert not label["excited"] and label["snr_reached"] == 0


@pytest.mark.parametrize("engine", BOTH)
def test_friction_loops_have_the_same_area_at_every_rate(engine: str) -> None:
    body, forms = (
        (Body(joint_friction=1e-3), Forms()) if engine == "mujoco" else (Body(), Forms(friction=1e-3))
    )
    areas = []
    for period in (8, 80):
        pressure = triangles(period, [1.0, 1.0])
        (angle,) = angles(engine, Truth(forms, body), make_run(pressure))
        areas.append(loop_area(pressure, angle, round(period / 0.4)))
    assert areas[0] > 100 and areas[1] == pytest.approx(areas[0], rel=0.15)


def expected_viscous_area(damping: float, power: float, period_s: float) -> float:
    """Return ∮ u dp of a slightly damped hanging joint: the angle lags by damping · rate^power / stiffness."""
    p = np.linspace(0, PRESSURE_MAX_PA, 2001)
    weight = JOINT.mass_kg / 2 * GRAVITY_M_S2 * JOINT.length_m / 4  # times sin u, nearly u
    b = B_E - M_A * p + weight
    u = (np.sqrt(b * b + 2 * M_E * K_N * p) - b) / M_E
    rate = np.gradient(u, p) * PRESSURE_MAX_PA / (period_s / 2)
    behind = damping * rate**power / (b + M_E * u)
    return float(2 * np.trapezoid(behind, p))


@pytest.mark.parametrize(
    ("engine", "power"), [("mujoco", 1.0), ("mujoco", 0.7), ("explicit", 0.7), ("functional", 0.8)]
)
def test_viscous_loops_grow_as_the_rate_to_its_power(engine: str, power: float) -> None:
    damping = 1e-3 if power < 1.0 else 1e-3 + mujoco_truth.AIR_DAMPING
    truth = Truth(Forms(viscous=1e-3, viscous_power=power))
    areas = []
    for period in (20, 80):
        pressure = triangles(period, [1.0, 1.0])
        (angle,) = angles(engine, truth, make_run(pressure))
        areas.append(loop_area(pressure, angle, round(period / 0.4)))
        assert areas[-1] == pytest.approx(expected_viscous_area(damping, power, period), rel=0.15)
    assert areas[0] / areas[1] == pytest.approx(4**power, rel=0.15)


@pytest.mark.parametrize("engine", BOTH)
def test_mullins_softens_after_the_first_loading_only(engine: str) -> None:
    truth, n = Truth(Forms(mullins=0.3, mullins_scale=0.1)), 50
    once = triangles(20, [1.0])
    runs = (make_run(triangles(20, [1.0] * 3)), make_run(once), make_run(once, specimen="B"))
    first, again, other = change(engine, truth, *runs)
    assert np.abs(first[2 : n // 2]).max() < 0.1 * SIGMA_RAD  # the virgin loading
    assert first[n:].max() > 2 * SIGMA_RAD
    assert first[2 * n :] == pytest.approx(first[n : 2 * n], abs=1e-3)
    assert again == pytest.approx(first[n : 2 * n], abs=1e-3)  # the next run of the same specimen
    assert np.abs(other[2 : n // 2]).max() < 0.1 * SIGMA_RAD  # a virgin one


@pytest.mark.parametrize("engine", BOTH)
def test_a_supply_lag_is_gone_in_holds_and_vents_slower(engine: str) -> None:
    holds = PRESSURE_MAX_PA * steps((0.6, 1.0, 0.0), 20.0)
    (lag,) = change(engine, Truth(Forms(lag_s=0.6)), make_run(holds))
    assert np.abs(lag).max() > 3 * SIGMA_RAD
    ends = [slice(50 * k + 50 + END, 50 * k + 50) for k in range(3)]
    assert all(np.abs(lag[end]).max() < 0.02 * SIGMA_RAD for end in ends)
    loads = make_run(np.full(50, 1e4), LOAD_N_M * np.minimum(1, np.arange(50) / 3))
    assert np.abs(change(engine, Truth(Forms(lag_s=0.6)), loads)[0]).max() < 1e-6


def chamber_after_steps(levels: Array, dt: float, f: Forms) -> Array:
    """Return the (t,) pressure in the chamber, Pa, from zero, with the levels commanded at steps of dt."""
    supply = np.zeros(3)
    return np.array([arriving(supply, level, level, 1.0, dt, f) for level in levels])


def test_an_orifice_fills_along_a_parabola_and_vents_through_a_smaller_one() -> None:
    """√Δ decreases linearly, √p_s (1 − t / 2T); below 4 % the flow is linear."""
    f, dt = Forms(lag_s=0.5, lag_vent=1.6, lag_linear=0.04, lag_second=1e-6), 0.01
    p = chamber_after_steps(PRESSURE_MAX_PA * np.repeat([1.0, 0.0], 300), dt, f)
    t = dt * np.arange(1, 301)
    turbulent = t < 0.79  # √Δ reaches √0.04 after 2 T (1 − 0.2)
    wanted = PRESSURE_MAX_PA * (1 - t / 1.0) ** 2
    assert PRESSURE_MAX_PA - p[:300][turbulent] == pytest.approx(wanted[turbulent], rel=1e-9)
    laminar = t > 0.81
    slow = 0.04 * PRESSURE_MAX_PA * np.exp(-(t - 0.8) / (0.5 * 0.2))
    assert PRESSURE_MAX_PA - p[:300][laminar] == pytest.approx(slow[laminar], abs=1e-6)
    venting = t < 1.6 * 0.79
    assert p[300:][venting] == pytest.approx(PRESSURE_MAX_PA * (1 - t[venting] / 1.6) ** 2, rel=1e-6)


def test_a_hose_behind_the_orifice_adds_its_delay_and_step_parts_change_little() -> None:
    f = Forms(lag_s=0.5, lag_second=0.2)
    ramp = PRESSURE_MAX_PA * np.linspace(0.0, 1.0, 2001)[1:]
    behind = [chamber_after_steps(ramp, 0.01, one)[-1] for one in (f, f._replace(lag_second=1e-6))]
    assert behind[1] - behind[0] == pytest.approx(ramp[0] / 0.01 * 0.1, rel=0.06)  # half a step of 0.01 s
    jump = np.full(200, PRESSURE_MAX_PA)
    coarse, fine = chamber_after_steps(jump, 0.01, f), chamber_after_steps(np.repeat(jump, 10), 0.001, f)
    assert coarse == pytest.approx(fine[9::10], abs=0.02 * PRESSURE_MAX_PA)
    assert fine[0] < 0.01 * (fine[-1]) and np.all(np.diff(fine) >= 0)


def test_a_second_order_supply_overshoots_by_its_damping() -> None:
    zeta = 0.7
    f = Forms(lag_s=0.5, lag_vent=1.0, lag_second=zeta, lag_shape=SECOND_ORDER)
    p = chamber_after_steps(np.full(2000, PRESSURE_MAX_PA), 0.005, f)
    over = np.exp(-np.pi * zeta / np.sqrt(1 - zeta**2))
    assert p.max() / PRESSURE_MAX_PA - 1 == pytest.approx(over, rel=1e-3)
    assert np.sum(PRESSURE_MAX_PA - p) * 0.005 == pytest.approx(
        0.5 * PRESSURE_MAX_PA, rel=0.01
    )  # as late as stated
    coarse = chamber_after_steps(np.full(200, PRESSURE_MAX_PA), 0.05, f)
    assert coarse == pytest.approx(p[9::10], abs=1e-6)


@pytest.mark.parametrize("engine", ALL)
def test_a_dead_time_is_added_to_the_lag_on_a_ramp(engine: str) -> None:
    ramp = make_run(PRESSURE_MAX_PA * np.linspace(0.0, 1.0, 101))
    late = Truth(Forms(lag_s=0.5, lag_vent=1.0, lag_second=1.0, lag_shape=DEAD_TIME))
    (found,), (plain,) = angles(engine, late, ramp), angles(engine, Truth(), ramp)
    assert found[60] == pytest.approx(np.interp(60 * 0.4 - 1.0, ramp.time_s, plain), abs=2e-4)
    assert abs(found[60] - plain[60]) > 6e-3


def test_a_set_that_is_late_comes_to_what_it_is_at_once_and_a_saturating_one_stops() -> None:
    held = make_run(PRESSURE_MAX_PA * steps((1.0, 0.0), 40.0))
    shares = (Forms(set_share=0.05, set_power=1.0), Forms(set_share=0.05, set_power=1.0, set_delay_s=4.0))
    at_once, late = (change("functional", Truth(f), held)[0] for f in shares)
    assert late[-1] == pytest.approx(at_once[-1], abs=0.1 * SIGMA_RAD) and abs(late[5]) < 0.8 * abs(
        at_once[5]
    )
    f = Forms(set_limit=1.0)
    assert stretched(0.036, f) == pytest.approx(0.01, rel=0.01) and stretched(3.6, f) == pytest.approx(1.0)


def test_a_viscoelastic_joint_drifts_in_holds_and_comes_back() -> None:
    forms = Forms(branch_1=0.01, branch_2=0.01, branch_3=0.01, time_1_s=1.5, time_2_s=5.0, time_3_s=15.0)
    (late,) = change("functional", Truth(forms), make_run(PRESSURE_MAX_PA * steps((1.0,), 200.0)))
    assert late[4] < -2 * SIGMA_RAD and np.all(np.diff(late[4:]) > 0) and abs(late[-1]) < 0.01 * SIGMA_RAD
    rates = np.diff(late[4:])  # the rate falls by less than a single exponential predicts
    assert rates[50] / rates[25] > 1.3 * rates[25] / rates[0]


def test_a_set_grows_as_the_largest_angle_squared_and_stays() -> None:
    levels = PRESSURE_MAX_PA * steps((0.5, 0.0, 1.0, 0.0, 0.4, 0.0), 10.0)
    run = make_run(levels)
    (angle,) = angles("functional", Truth(Forms(set_share=0.02)), run)
    rests, tops = angle[[49, 99, 149]], [angle[:25].max(), angle[:75].max()]
    assert rests[1] / rests[0] == pytest.approx((tops[1] / tops[0]) ** 2, rel=0.02)
    assert rests[2] == pytest.approx(rests[1], rel=1e-6)


@pytest.mark.parametrize("engine", BOTH)
def test_what_is_silent_without_pressure_or_below_contact(engine: str) -> None:
    loads = make_run(np.zeros(60), LOAD_N_M * steps((1.0, -1.0, 0.0), 8.0))
    contact = Forms(contact=0.5, contact_at=0.3, contact_power=2.0)
    for forms in (Forms(gain=0.2), Forms(dead_pa=1e3), contact):
        assert np.abs(change(engine, Truth(forms), loads)[0]).max() < 1e-6
    for forms in (Forms(stiffness=0.2), Forms(offset_pa=500.0)):
        assert np.abs(change(engine, Truth(forms), loads)[0]).max() > SIGMA_RAD


@pytest.mark.parametrize("engine", BOTH)
def test_heat_and_weight_show_in_their_own_runs_only(engine: str) -> None:
    pressure = triangles(20, [1.0])
    conditions = ({}, {"temperature_c": 52.0}, {"base_angles_rad": (0.0, np.pi / 2, 0.0)})
    runs = [make_run(pressure, **one) for one in conditions]
    warm = change(engine, Truth(Forms(thermal=0.01)), *runs)
    assert np.abs(warm[0]).max() == 0 and warm[1].max() > 2 * SIGMA_RAD and np.abs(warm[2]).max() == 0
    heavy = change(engine, Truth(body=Body(fitting_kg=0.01)), *runs)
    assert np.abs(heavy[2]).max() > 4 * np.abs(heavy[0]).max()


def test_a_sensor_bias_is_nearly_constant() -> None:
    found = made("sensor_bias", protocol="poor")
    pairs = zip(found.hidden, found.clean, strict=True)
    shift = np.concatenate([h["angle_rad"] - c["angle_rad"] for h, c in pairs])
    assert np.std(shift) < 0.1 * abs(np.mean(shift))


@pytest.mark.parametrize("split", ["judged", "calibration"])
def test_noise_has_the_variance_and_the_correlation_that_it_states(split: str) -> None:
    spectrum, n, dt = SPECTRA[split], 2000, 0.4
    rng = np.random.default_rng(5)
    runs = [draw_noise(spectrum, dt * np.arange(n), rng) for _ in range(60)]
    within = [run - run.mean() for run in runs]
    offsets = [draw_noise(spectrum, dt * np.arange(100), rng).mean() for _ in range(2000)]
    assert np.mean([np.var(run) for run in within]) == pytest.approx(1.0, rel=0.03)
    for lag in (1, 5, 10):
        expected = spectrum.coloured_share * np.exp(-lag * dt / spectrum.correlation_s)
        correlation = np.mean([np.mean(run[lag:] * run[:-lag]) for run in within])
        assert correlation == pytest.approx(expected, abs=0.02)
    lags = np.arange(-99, 100)  # the mean of a run contains that of the coloured noise, too
    pairs = (100 - np.abs(lags)) * np.exp(-np.abs(lags) * dt / spectrum.correlation_s) / 100**2
    mean = spectrum.coloured_share * pairs.sum() + (1 - spectrum.coloured_share) / 100
    wanted = np.sqrt(spectrum.run_offset**2 + mean)
    assert np.std(offsets) == pytest.approx(wanted, rel=3 / np.sqrt(2 * 2000))


def test_two_hidden_effects_are_scaled_one_by_one() -> None:
    both = make_set(SetSpec("sensor_bias+stiffness", 3, snr=2.0, protocol="rates"))
    assert both.label["kinds"] == ["sensor_bias", "stiffness"]
    assert both.label["snr_alone"] == pytest.approx([2.0, 2.0], rel=0.03)
    bias = both.label["strengths"][0] * 0.015 * both.label["drawn"]["sensor_bias.sign"]
    joined = np.concatenate([run["angle_rad"] for run in both.hidden])
    other = np.concatenate([run["angle_rad"] for run in make_set(SetSpec(CLEAN, 3, protocol="rates")).clean])
    # Unbent, the bias is the reading.
    assert np.median(joined[other < 0.02]) == pytest.approx(bias, abs=0.01)


def test_a_set_is_its_spec_and_reads_as_a_measurement(tmp_path: object) -> None:
    spec = SetSpec("mullins", 7)
    one, again = make_set(spec), make_set(spec)
    assert one.csv == again.csv and one.label == again.label
    assert make_set(SetSpec("mullins", 8)).csv != one.csv
    rows = list(csv.DictReader(io.StringIO(one.csv)))
    assert len(rows) == sum(len(run) for run in protocol("rich"))
    assert {row["specimen"] for row in rows} == {"A", "B"} and len({row["run"] for row in rows}) == 30
    read = np.array([float(row["angle_rad"]) for row in rows])
    hidden = np.concatenate([run["angle_rad"] for run in one.hidden])
    assert np.std(read - hidden) == pytest.approx(one.sigma["angle_rad"], rel=0.15)
    assert "mullins" not in one.csv + one.study


@pytest.mark.parametrize("name", sorted(ROBOTS))
def test_the_study_given_away_is_a_study(name: str, tmp_path: object) -> None:
    path = tmp_path / "study.yaml"
    path.write_text(ROBOTS[name].study("under-test"))
    study = load_study(path, discover())
    assert study.chain.modules == ROBOTS[name].modules


def test_protocols_are_what_their_table_says() -> None:
    runs = {name: protocol(name) for name in NAMES}
    counts = {"rich": 30, "rich_noload": 26, "rates": 9, "poor": 5, "midway": 30, "coarse": 12, "example": 16}
    counts |= {"payload": 26, "rich_open": 28}
    assert {name: len(found) for name, found in runs.items()} == counts
    assert 4000 < sum(len(run) for run in runs["rich"]) < 4300
    rich = runs["rich"]
    conditions = [run.condition for run in rich]
    assert all(conditions.count(name) == 2 for name in conditions)  # each done twice
    for a, b in zip(rich[:15], rich[15:], strict=True):
        assert a.specimen != b.specimen and np.array_equal(a.pressure_pa, b.pressure_pa)


def test_recordings_begin_in_mid_transient_and_hold_what_a_whole_one_does_then() -> None:
    spec = SetSpec("viscous_damping", 5, protocol="midway", snr=2.0)
    found, runs = make_set(spec), protocol("midway")
    rows = list(csv.DictReader(io.StringIO(found.csv)))
    assert (
        len(rows)
        == sum(int(run.kept.sum()) for run in runs)
        == sum(len(r["angle_rad"]) for r in found.hidden)
    )
    moving, lost = 0, 0
    for run in runs:
        cut, first = run.recorded(), int(np.argmax(run.kept))
        assert (
            cut.time_s[0] == 0 and cut.pressure_pa[0] == run.pressure_pa[first] and len(cut) == run.kept.sum()
        )
        before, after = ((run.pressure_pa[k], run.moment_n_m[k]) for k in (first - 1, first))
        moving += before != after
        lost += bool(np.diff(cut.time_s).max() > 5.0)
    assert moving == len(runs) and lost >= 10
    whole = [Run(**{**vars(run), "kept": None}) for run in runs]
    truth = draw(spec.kind, spec.engine, JOINT, spec.split, spec.generator()).at(*found.label["strengths"])
    full = follow("functional", JOINT, tuple(whole), truth, np.zeros(len(runs)))
    for run, one, part in zip(runs, full, found.hidden, strict=True):
        assert np.array_equal(one["angle_rad"][run.kept], part["angle_rad"])


def test_coarse_samples_are_from_truths_that_are_followed_finely(monkeypatch: pytest.MonkeyPatch) -> None:
    runs = protocol("coarse")
    assert all(np.allclose(np.diff(run.time_s), 0.4) for run in runs)
    truth = Truth(Forms(viscous=0.005, viscous_power=0.7))  # of 0.2 s
    coarse, plain = (follow("functional", JOINT, runs, t, np.zeros(len(runs))) for t in (truth, Truth()))
    monkeypatch.setattr("benchmarks.evidence.functional_truth.LONGEST_QUICK_S", 0.004)
    fine = follow("functional", JOINT, runs, truth, np.zeros(len(runs)))
    sigma = noise_sizes(plain)
    assert signal(coarse, fine, sigma) < 0.1 * signal(plain, fine, sigma)


def test_calibration_sets_are_other_sets() -> None:
    judged, other = (
        make_set(SetSpec("friction_hysteresis", 0, split=split, protocol="poor"))
        for split in ("judged", "calibration")
    )
    assert judged.csv != other.csv and judged.label["drawn"] != other.label["drawn"]
    assert make_set(SetSpec(CLEAN, 0, split="calibration", protocol="poor")).label["right"] == [
        "nothing_missing"
    ]
