"""Predictions of measured runs: outputs by name, the study's effects, other histories, derivatives."""

from __future__ import annotations

import numpy as np
import pytest
from tests.diagnosis.quick import BENCH, ENGINE, P, blank, effect, make_predictor, ramp

from pliant.errors import NotReachedError, UserError
from pliant.evidence.prediction import Predictor
from pliant.mechanics.kinematics import ChainGeometry, base_rotations, trajectory
from pliant.records.history import History
from pliant.records.measurement import Measurement
from pliant.records.term import LawTerm
from pliant.testing.samples import linear_prismatic_law, sample_chain

CHAIN = sample_chain(modules=3, turns_rad=(0.0, 0.4), payload=0.004)
N = CHAIN.n_joints
RUNS = [ramp("a", 3e3, 0.5), ramp("b", 3e3, 0.5, base_angles_rad=[0.2, 0.7, -0.3], specimen="B")]
POSITIONS = [
    f"{marker}_{axis}_m" for marker in ("tip", "marker_1", "marker_4", f"marker_{N + 1}") for axis in "xyz"
]
NAMES = ["angle_rad", *(f"joint_{k}_angle_rad" for k in range(1, N + 1)), *POSITIONS]


def read(*names: str, **more: object) -> tuple[dict[str, np.ndarray], ...]:
    measurement = blank(RUNS, names or NAMES)
    return make_predictor(
        CHAIN, Measurement(measurement.runs, measurement.outputs, "bench.csv", **more)
    ).predict()


def marker_path(run: int) -> np.ndarray:
    paths, _ = ENGINE.follow(CHAIN, RUNS)
    turns = base_rotations(CHAIN.base_rotation, RUNS[run].base_angles_rad)
    return trajectory(ChainGeometry.from_chain(CHAIN), paths[run].joint_angles, turns)


def test_angles_are_joints_and_their_sum() -> None:
    paths, _ = ENGINE.follow(CHAIN, RUNS)
    for run, path in zip(read(), paths, strict=True):
        for k in range(N):
            np.testing.assert_array_equal(run[f"joint_{k + 1}_angle_rad"], path.joint_angles[:, k, 0])
        np.testing.assert_allclose(run["angle_rad"], path.joint_angles.sum(axis=(1, 2)), rtol=1e-12)


@pytest.mark.parametrize("run", [0, 1])
def test_marker_k_is_joint_k_and_the_last_one_the_tip(run: int) -> None:
    readings, markers = read()[run], marker_path(run)
    for name, place in (("tip", N + 1), ("marker_1", 1), ("marker_4", 4), (f"marker_{N + 1}", N + 1)):
        got = np.stack([readings[f"{name}_{axis}_m"] for axis in "xyz"], axis=1)
        np.testing.assert_allclose(got, markers[:, place], atol=1e-15)


def test_a_marker_beside_the_line_turns_with_its_piece() -> None:
    length, aside = CHAIN.length_m, (0.002, -0.01, 0.02)
    names = [f"marker_{k}_{axis}_m" for k in (1, 2) for axis in "xyz"]
    on = read(*names, marker_arms_m=(0.0055, length))
    off = read(*names, marker_arms_m=(0.0055, length), marker_offsets_m=(aside, aside))
    paths, _ = ENGINE.follow(CHAIN, RUNS)
    for run, (line, beside) in enumerate(zip(on, off, strict=True)):
        turns = base_rotations(CHAIN.base_rotation, RUNS[run].base_angles_rad)
        for marker, body in ((1, 0), (2, N)):
            moved = np.stack(
                [(beside[n] - line[n]) for n in names if n.startswith(f"marker_{marker}")], axis=1
            )
            for t in range(len(moved)):
                bent = CHAIN.with_(base_rotation=turns[t])
                frame = ChainGeometry.from_chain(bent).forward(paths[run].joint_angles[t]).rotations[body]
                np.testing.assert_allclose(moved[t], frame @ aside, atol=1e-12)


def test_markers_with_arms_lie_on_the_rigid_pieces() -> None:
    length = CHAIN.length_m
    arms = (0.0, 0.0055, 0.011, length - 0.001, length)
    names = [f"marker_{k}_x_m" for k in range(1, 6)]
    readings, markers = read(*names, marker_arms_m=arms)[0], marker_path(0)[:, :, 0]
    wanted = [
        markers[:, 0],
        markers[:, 1],
        0.5 * (markers[:, 1] + markers[:, 2]),
        markers[:, -1] + (markers[:, -2] - markers[:, -1]) * 0.001 / 0.0055,
        markers[:, -1],
    ]
    for name, values in zip(names, wanted, strict=True):
        np.testing.assert_allclose(readings[name], values, atol=1e-12)


def test_a_marker_beyond_the_chain_is_refused() -> None:
    with pytest.raises(UserError, match=r"marker 2 is said to sit 11 m along a chain that is 0.066 m long"):
        read("marker_1_x_m", "marker_2_x_m", marker_arms_m=(0.005, 11.0))


def test_prismatic_chains_read_a_strain() -> None:
    chain = sample_chain(linear_prismatic_law(), modules=2, gravity=(0, 0, 0))
    runs = [History.from_arrays({"pressure_pa": np.array([0.0, P])}, np.arange(2.0))]
    predictor = make_predictor(chain, blank(runs, ["elongation_strain", "angle_rad"]))
    assert predictor.missing == ("angle_rad",)
    law = linear_prismatic_law()
    wanted = 2 * law.gain[0] * P / law.stiffness[0, 0] / 0.022
    assert predictor.predict()[0]["elongation_strain"] == pytest.approx([0.0, wanted])


@pytest.mark.parametrize(
    "name", ["joint_0_angle_rad", "joint_7_angle_rad", f"marker_{N + 2}_x_m", "elongation_strain"]
)
def test_outputs_that_the_model_lacks_are_told(name: str) -> None:
    assert make_predictor(CHAIN, blank(RUNS, ["angle_rad", name])).missing == (name,)
    with pytest.raises(UserError, match=f"none of the measured outputs \\({name}\\); a chain of 6 revolute"):
        make_predictor(CHAIN, blank(RUNS, [name]))


def test_a_sensor_bias_moves_angles_and_no_position() -> None:
    predictor = make_predictor(CHAIN, blank(RUNS, NAMES))
    plain, biased = predictor.predict()[0], predictor.predict([effect("sensor_bias", bias_rad=0.03)])[0]
    for name in NAMES:
        shift = 0.0 if name.endswith("_m") else 0.03
        np.testing.assert_allclose(biased[name] - plain[name], shift, atol=1e-12)


def test_the_study_s_effects_are_always_there() -> None:
    gain, bias = effect("actuation_gain"), effect("sensor_bias")
    measurement = blank(RUNS, ["angle_rad", "tip_x_m"])
    study = make_predictor(CHAIN, measurement, gain, bias)
    bare = make_predictor(CHAIN, measurement)
    stiff = effect("stiffness")
    pairs = [
        (study.predict(), bare.predict([gain, bias])),
        (study.predict([stiff]), bare.predict([gain, bias, stiff])),
    ]
    for one, other in pairs:
        for a, b in zip(one, other, strict=True):
            for name in a:
                np.testing.assert_allclose(a[name], b[name], atol=1e-12)


def test_other_histories_are_read_with_their_own_base() -> None:
    predictor = make_predictor(CHAIN, blank(RUNS[:1], ["tip_x_m"]))
    there = predictor.evaluate((), [RUNS[1], RUNS[0]])
    wanted = make_predictor(CHAIN, blank(RUNS, ["tip_x_m"])).predict()
    np.testing.assert_allclose(there.runs[0]["tip_x_m"], wanted[1]["tip_x_m"], atol=1e-12)
    np.testing.assert_allclose(there.runs[1]["tip_x_m"], wanted[0]["tip_x_m"], atol=1e-12)


def test_an_effect_that_moves_the_base_moves_the_readings() -> None:
    """A model with turned inputs or a turned chain is read in its actual pose, not in the bench's nominal one."""

    class Turned(Predictor):
        def _changed(self, model, effects):
            made = super()._changed(model, effects)
            if not effects:
                return made
            return made.with_input(lambda h: h.with_(base_angles_rad=h.base_angles_rad + [0.0, 0.5, 0.0]))

    measurement = blank(RUNS[:1], ["tip_x_m"])
    turned = Turned(BENCH, ENGINE, CHAIN, measurement).predict([effect("stiffness", factor=1.0)])
    meant = blank([RUNS[0].with_(base_angles_rad=RUNS[0].base_angles_rad + [0.0, 0.5, 0.0])], ["tip_x_m"])
    np.testing.assert_allclose(
        turned[0]["tip_x_m"], make_predictor(CHAIN, meant).predict()[0]["tip_x_m"], atol=1e-12
    )


@pytest.mark.parametrize("kind", ["stiffness", "supply_lag", "mullins", "sensor_bias", "gravity_scale"])
def test_reading_changes_are_prediction_differences(kind: str) -> None:
    predictor = make_predictor(CHAIN, blank(RUNS, ["angle_rad", "tip_z_m"]))
    base = effect(kind)
    name = next(field for field in type(base).model_fields if field != "kind")
    value = getattr(base, name)

    def at(x: float) -> list:
        return [base.model_copy(update={name: value * x})]

    _, (change,) = predictor.vary(at(1.0), [at(1.0 + 1e-5)])
    up, down = predictor.predict(at(1.001)), predictor.predict(at(0.999))
    for moved, a, b in zip(change, up, down, strict=True):
        for output, got in moved.items():
            wanted = (a[output] - b[output]) / 2e-3
            assert np.quantile(np.abs(got / 1e-5 - wanted), 0.95) < 5e-3 * np.abs(wanted).max() + 1e-9


def impossible(angle, rate, dt, p, t, old, new, c):
    return 1e9 if p > c[0] else 0.0


def test_states_without_equilibrium_read_nothing() -> None:
    def predicted(above: float):
        chain = CHAIN.with_(terms=(LawTerm("moment", impossible, (above,)),))
        return make_predictor(chain, blank(RUNS, ["angle_rad", "tip_x_m"]))

    some = predicted(10e3).evaluate()
    for run, history in zip(some.runs, RUNS, strict=True):
        lost = history.actuation["pressure_pa"] > 10e3
        for values in run.values():
            np.testing.assert_array_equal(np.isnan(values), lost)
    assert some.n_failed == sum(int((h.actuation["pressure_pa"] > 10e3).sum()) for h in RUNS)
    with pytest.raises(NotReachedError, match="no equilibrium in any"):
        predicted(-1.0).predict()


def test_dynamics_faster_than_the_sampling_are_integrated_finely() -> None:
    """A dashpot of T = 0.2 s on a linear joint, read every 0.4 s, against e^(−t/T): twice the steps change little."""
    time_s = 0.4 * np.arange(40)
    push = np.where((time_s >= 2.0) & (time_s < 9.0), 1e-5, 0.0)  # small: a linear joint
    history = History.from_arrays({"pressure_pa": 0.0 * time_s}, time_s, moment_n_m=push)
    chain = sample_chain(modules=1).with_(gravity_m_s2=np.zeros(3))
    predictor = make_predictor(chain, blank([history]))
    static = predictor.predict()[0]["angle_rad"]
    read = predictor.predict([effect("viscous_damping", time_s=0.2)])[0]["angle_rad"]
    exact, fine = [0.0], np.interp(0.001 * np.arange(15601), time_s, static)
    for goal in fine[1:]:
        exact.append(exact[-1] + (goal - exact[-1]) * (1.0 - np.exp(-0.001 / 0.2)))
    found = np.array(exact)[::400]
    coarse = predictor.evaluate([effect("viscous_damping", time_s=0.2)]).runs[0]["angle_rad"]
    span = np.ptp(found)
    assert np.abs(read - found).max() < 0.004 * span and np.abs(coarse - found).max() > 0.05 * span


def test_models_without_memory_need_one_step_and_runs_without_a_clock_too() -> None:
    predictor = make_predictor(sample_chain(modules=1), blank([ramp("run", 5e3, 0.5)]))
    assert predictor.steps_between_samples([effect("stiffness", factor=1.2)]) == 1
    assert predictor.steps_between_samples([effect("viscous_damping", time_s=0.3)]) > 1
    still = History.from_arrays({"pressure_pa": np.linspace(0.0, P, 9)})
    assert (
        make_predictor(sample_chain(modules=1), blank([still])).steps_between_samples(
            [effect("friction_hysteresis")]
        )
        == 1
    )


@pytest.mark.parametrize("parts", [2, 5])
def test_a_refined_history_goes_through_the_samples_along_straight_lines(parts: int) -> None:
    rng = np.random.default_rng(parts)
    time_s = np.cumsum(rng.uniform(0.1, 1.0, 12))
    valve = (rng.random(12) > 0.4).astype(float)
    history = History.from_arrays(
        {"pressure_pa": rng.normal(size=12)}, time_s, moment_n_m=rng.normal(size=12), valve_open=valve
    )
    fine = history.refined(parts)
    assert len(fine) == 11 * parts + 1
    for name, values in history.signals().items():
        assert np.allclose(fine.signals()[name][::parts], values, rtol=0, atol=1e-12)
    between = np.interp(fine.time_s, time_s, history.actuation["pressure_pa"])
    assert np.allclose(fine.actuation["pressure_pa"], between)
    assert np.array_equal(
        fine.valve_open[1:], np.repeat(valve[1:], parts)
    )  # of the step that ends at a sample
