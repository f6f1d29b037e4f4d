"""Mistakes of the record: each is named, and correct records raise none."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.diagnosis.quick import (
    BENCH,
    ENGINE,
    blank,
    colour,
    effect,
    joint,
    make_measurement,
    pushes,
    ramp,
    rich,
)

from pliant import api
from pliant.evidence.bookkeeping.findings import find_mistakes
from pliant.evidence.bookkeeping.mistake import Mistake
from pliant.evidence.prediction import Predictor
from pliant.interfaces.effect import EffectConfig
from pliant.records.chain import ChainModel
from pliant.records.history import History
from pliant.records.measurement import MeasuredRun, Measurement
from pliant.testing.samples import sample_chain

ROOT = Path(__file__).parents[2]
TRIALS = ROOT.parent / "shared" / "trials"
PLANE = ("angle_rad", "tip_x_m", "tip_z_m")
PSI_PA = 6894.757
NO_GRAVITY = (0, 0, 0)


def recorded(
    chain: ChainModel,
    histories: Sequence[History],
    *effects: EffectConfig,
    outputs: Sequence[str] = PLANE,
    seed: int = 0,
) -> Measurement:
    """Return the readings of this chain with coloured noise of 2 mrad and 0.1 mm."""
    rng = np.random.default_rng(seed)
    readings = Predictor(BENCH, ENGINE, chain, blank(histories, outputs)).predict(effects)
    noisy = [
        {n: v + colour(rng, len(v), 2e-3 if n.endswith("_rad") else 1e-4, 0.6) for n, v in run.items()}
        for run in readings
    ]
    return make_measurement(histories, noisy)


def mistakes(chain: ChainModel, measurement: Measurement) -> tuple[Mistake, ...]:
    return find_mistakes(Predictor(BENCH, ENGINE, chain, measurement))


def changed(
    measurement: Measurement, change: Callable[[MeasuredRun], MeasuredRun], **more: Any
) -> Measurement:
    return replace(measurement, runs=tuple(map(change, measurement.runs)), **more)


def pressed(factor: float) -> Callable[[MeasuredRun], MeasuredRun]:
    """Return the measurement whose recorded pressures are the true ones times this factor."""

    def change(run: MeasuredRun) -> MeasuredRun:
        pressure = factor * run.history.actuation["pressure_pa"]
        return replace(run, history=run.history.with_actuation(pressure_pa=pressure))

    return change


def reading(factors: Mapping[str, float]) -> Callable[[MeasuredRun], MeasuredRun]:
    """Return the measurement whose recorded readings are the true ones times these factors."""
    return lambda run: run.with_outputs({n: factors.get(n, 1.0) * v for n, v in run.outputs.items()})


CHAIN = joint(4)
RUNS = rich(1)
CLEAN = recorded(CHAIN, RUNS)


@pytest.mark.parametrize(
    ("change", "written", "kind", "says"),
    [
        (pressed(1e3 / PSI_PA), {"pressure_pa": "kPa"}, "unit", "pressure_pa is in psi, not in kPa"),
        (pressed(0.01), {"pressure_pa": "Pa"}, "unit", "pressure_pa is in mbar, not in Pa"),
        (pressed(PSI_PA / 1e3), {}, "unit", "pressure_pa is kPa that was taken for psi"),
        (
            reading({"angle_rad": 180 / np.pi}),
            {"angle_rad": "rad"},
            "unit",
            "angle_rad is in deg, not in rad",
        ),
        (
            reading({"angle_rad": np.pi / 180}),
            {"angle_rad": "deg"},
            "unit",
            "angle_rad is in rad, not in deg",
        ),
        (reading({"tip_x_m": 1e3, "tip_z_m": 1e3}), {}, "unit", "tip_x_m and tip_z_m are in mm, not in m"),
        (
            reading({"tip_x_m": 1 / 2.54, "tip_z_m": 1 / 2.54}),
            {"tip_x_m": "cm", "tip_z_m": "cm"},
            "unit",
            "tip_x_m and tip_z_m are in inch, not in cm",
        ),
        (pressed(-1.0), {}, "sign", "pressure_pa has the wrong sign"),
        (reading({"angle_rad": -1.0}), {}, "sign", "angle_rad has the wrong sign"),
        (reading({"tip_x_m": -1.0}), {}, "sign", "x = −x of the file"),
    ],
)
def test_wrong_units_and_signs_are_named(
    change: Callable[[MeasuredRun], MeasuredRun], written: Mapping[str, str], kind: str, says: str
) -> None:
    (found,) = mistakes(CHAIN, changed(CLEAN, change, written=written))
    assert found.kind == kind and says in found.words
    assert found.error_after < 0.05 < 0.3 < found.error_before
    assert found.remedy.endswith(".") and (kind != "unit" or "units: {" in found.remedy or written == {})


def test_exchanged_axes_are_named() -> None:
    def exchanged(run: MeasuredRun) -> MeasuredRun:
        return run.with_outputs(
            {**run.outputs, "tip_x_m": run.outputs["tip_z_m"], "tip_z_m": run.outputs["tip_x_m"]}
        )

    (found,) = mistakes(CHAIN, changed(CLEAN, exchanged))
    assert found.kind == "exchanged" and "x = z of the file, z = x of the file" in found.words


def test_a_load_with_a_wrong_sign_or_unit_is_named() -> None:
    def moments(factor: float) -> Callable[[MeasuredRun], MeasuredRun]:
        return lambda run: replace(run, history=run.history.with_(moment_n_m=factor * run.history.moment_n_m))

    (sign,) = mistakes(CHAIN, changed(CLEAN, moments(-1.0)))
    (unit,) = mistakes(CHAIN, changed(CLEAN, moments(100.0)))
    assert sign.kind == "sign" and "moment_n_m has the wrong sign" in sign.words
    assert unit.kind == "unit" and "moment_n_m is in N*cm, not in N*m" in unit.words


def test_gravity_that_was_forgotten_is_named_by_the_rest_pose() -> None:
    """A joint held level sags by 0.3° at rest; the study has no gravity."""
    base = {"direction": [1, 0, 0]}
    truth = sample_chain(modules=1, base=base, payload=0.004)
    histories = [ramp(f"r{k}", 2e3, 0.5) for k in range(3)]
    measurement = recorded(truth, histories, outputs=("angle_rad",))
    sag = float(np.degrees(abs(Predictor(BENCH, ENGINE, truth, measurement).predict()[0]["angle_rad"][0])))
    assert 0.2 < sag < 0.6
    first, *_ = mistakes(sample_chain(modules=1, base=base, payload=0.004, gravity=NO_GRAVITY), measurement)
    assert first.kind == "gravity" and first.where == ("chain.gravity",)
    assert (
        first.words.startswith("At rest the recording and the model disagree") and "along −z" in first.words
    )
    assert first.remedy == "Take 'chain.gravity: [0, 0, 0]' out of the study."
    assert first.error_after < 0.35 * first.error_before


def test_a_chain_on_a_table_and_a_turned_base_are_named() -> None:
    table = recorded(joint(4, gravity=NO_GRAVITY), RUNS)
    first, *_ = mistakes(CHAIN, table)
    assert first.kind == "gravity" and "as if the chain lay on a table" in first.words
    (turned,) = mistakes(CHAIN.with_(base_rotation=np.eye(3)), CLEAN)
    assert turned.kind == "orientation" and "the chain points along −z" in turned.words


def test_a_rest_pose_that_nothing_explains_is_asked_about() -> None:
    first, *_ = mistakes(CHAIN, recorded(CHAIN, RUNS, effect("sensor_bias")))
    assert first.kind == "rest_pose" and first.where == ("angle_rad",)
    assert "bend angle is read as" in first.words and "zero" in first.remedy


def labelled(stated: Sequence[float], true: Sequence[float], *effects: EffectConfig) -> Measurement:
    """Return sweeps of eight modules with payloads, with labels changed afterwards."""
    chain = sample_chain(modules=8)
    runs = [ramp(f"m{k}", 2e3, 0.5, payload_kg=mass) for k, mass in enumerate(true)]
    measurement = recorded(chain, runs, *effects)
    labels = iter(stated)

    def label(run: MeasuredRun) -> MeasuredRun:
        return replace(run, history=run.history.with_(payload_kg=np.full(len(run), next(labels))))

    return changed(measurement, label)


@pytest.mark.parametrize(
    ("stated", "true", "says"),
    [
        ((0, 0, 13, 13), (0, 0, 19, 19), "the 2 runs labelled 13 g behave as if 19"),
        ((0, 5, 13, 13), (0, 5, 13, 19), "run 'm3' (labelled 13 g) behaves as if 19"),
        ((0, 5, 13, 20), (0, 6.5, 16.9, 26), "all of them by a factor of 1.3"),
        ((0, 5, 13, 20), (0, 8, 16, 23), "a hook or a holder"),
    ],
)
def test_payloads_that_disagree_with_their_labels(
    stated: Sequence[float], true: Sequence[float], says: str
) -> None:
    grams = [1e-3 * mass for mass in stated], [1e-3 * mass for mass in true]
    (found,) = mistakes(sample_chain(modules=8), labelled(*grams))
    assert found.kind == "payload" and says in found.words


def test_payloads_in_grams_that_were_taken_for_kilograms() -> None:
    (found,) = mistakes(sample_chain(modules=8), labelled((0, 5, 13, 20), (0, 0.005, 0.013, 0.02)))
    assert found.kind == "unit" and "payload_kg is in g, not in kg" in found.words


def test_readings_before_their_cause_are_a_clock() -> None:
    (early,) = mistakes(CHAIN, recorded(CHAIN, RUNS, effect("clock_offset", late_s=-0.5)))
    assert early.kind == "clock" and "Readings move 0.5 s before the inputs" in early.words
    assert not mistakes(CHAIN, recorded(CHAIN, RUNS, effect("clock_offset", late_s=0.5)))  # may be a supply


def test_readings_that_fall_behind_are_a_clock() -> None:
    runs = [ramp(f"long{k}", 3e3, 0.25, (15e3, 0.0) * 8) for k in range(2)]
    (drift,) = mistakes(CHAIN, recorded(CHAIN, runs, effect("clock_drift", rate=0.02)))
    assert drift.kind == "clock" and "later and later along a run, by 20 ms a second" in drift.words


def random_record(seed: int, *effects: EffectConfig) -> tuple[ChainModel, Measurement]:
    """Return a random chain, random runs and random sensors."""
    rng = np.random.default_rng(seed)
    gravity = NO_GRAVITY if rng.random() < 0.25 else (0, 0, -9.81)
    payload, modules = float(rng.choice([0, 0.003, 0.02])), int(rng.choice([1, 2, 4, 8]))
    chain = sample_chain(modules=modules, payload=payload, gravity=gravity)
    runs: list[History] = []
    for k in range(int(rng.integers(1, 5))):
        top = 15e3 * rng.uniform(0.4, 1.0)
        made = (
            ramp(f"r{k}", rng.uniform(500, 15e3), float(rng.choice([0.1, 0.5])), (top, 0.0, 0.6 * top, 0.0)),
            pushes(f"r{k}", rng.uniform(0, 15e3), moment=rng.uniform(1e-3, 6e-3)),
            ramp(f"r{k}", 2e3, 0.5, (top, 0.0), payload_kg=float(rng.choice([0, 0.005, 0.013]))),
            ramp(f"r{k}", 2e3, 0.5, (top, 0.0), base_angles_rad=[0.0, rng.choice([0.5, 1.0]) * np.pi, 0.0]),
        )[int(rng.integers(4))]
        runs += [made] if rng.random() < 0.5 else [made, made.with_(run=f"r{k} again")]
    outputs = (("angle_rad",), PLANE[1:], PLANE, ("tip_x_m", "tip_y_m", "tip_z_m"))[int(rng.integers(4))]
    return chain, recorded(chain, runs, *effects, outputs=outputs, seed=seed)


@pytest.mark.parametrize("seed", range(20))
def test_a_record_in_order_raises_none(seed: int) -> None:
    assert not mistakes(*random_record(seed))


@pytest.mark.parametrize(
    "kind",
    ["stiffness", "actuation_gain", "supply_lag", "viscoelastic", "friction_hysteresis", "gravity_scale"],
)
def test_physics_is_no_mistake_in_the_record(kind: str) -> None:
    for seed in range(100, 104):
        assert not mistakes(*random_record(seed, effect(kind)))


@pytest.mark.parametrize(
    "study",
    ["hidden_effect/finger", "next_experiment/finger", "opposed_chambers/joint", "clamped_chain/arm"],
)
def test_shipped_recordings_raise_none(study: str, tmp_path: Path) -> None:
    opened = api.open_study(ROOT / "examples" / f"{study}.yaml", store=tmp_path / "store")
    assert not find_mistakes(api.predictor(opened))


@pytest.mark.parametrize(
    ("study", "says"),
    [("B", "the 2 runs labelled 13 g behave as if 19"), ("Bone", "the 2 runs labelled 13 g behave as if 18")],
)
def test_the_payload_in_a_trial_is_named(study: str, says: str, tmp_path: Path) -> None:
    """The payload was 19 g on a base tilted by 4°; loaded runs alone determine it within 1 g."""
    path = TRIALS / "chain_payload_and_tilt" / f"{study}.yaml"
    if not path.is_file():
        pytest.skip(f"{path} is not here")
    found = api.compare(api.open_study(path, store=tmp_path / "store")).bookkeeping
    assert [one.kind for one in found] == ["rest_pose", "payload"]
    assert says in found[1].words
