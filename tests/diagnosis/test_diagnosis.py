"""From measurements to a verdict: single effects, pairs, none, and data as benches really leave them."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
import pytest
from tests.diagnosis.quick import (
    REGISTRY,
    SIGMA,
    VALUES,
    P,
    effect,
    joint,
    measured,
    poor,
    predictor_of,
    ramp,
    rich,
    run_of,
)

from pliant.diagnosis.diagnosis import Diagnosis, diagnose, explanation
from pliant.errors import NotReachedError, UserError
from pliant.interfaces.effect import EffectConfig
from pliant.records.chain import Actuator, ChainModel
from pliant.records.design import Array
from pliant.records.history import History
from pliant.records.measurement import Measurement
from pliant.records.term import LawTerm
from pliant.report.diagnosis import diagnosis_json

CHAIN = joint()


def warm_twice(repeats: int = 2) -> list[History]:
    """The rich protocol with a second temperature: what one condition alone shows cannot be checked on another."""
    more = [ramp(f"hot{k}", 3e3, 0.5, specimen="AB"[k], temperature_c=47.0) for k in range(repeats)]
    turned = [
        ramp(f"over{k}", 3e3, 0.5, specimen="AB"[k], base_angles_rad=[0.0, np.pi, 0.0])
        for k in range(repeats)
    ]
    return [*rich(repeats), *more, *turned]


def judged(
    measurement: Measurement, *study: EffectConfig, chain: ChainModel = CHAIN, **more: object
) -> Diagnosis:
    """The diagnosis; every sentence and number of it must be printable."""
    found = diagnose(predictor_of(chain, measurement, *study), **more)  # type: ignore[arg-type]
    values = diagnosis_json(found)
    assert sum(h["probability"] for h in values["hypotheses"]) == pytest.approx(1.0)
    words = [found.judgement.sentence, *explanation(found, REGISTRY), *found.remarks]
    assert all(text and "nan" not in text.split() for text in words)
    return found


@pytest.mark.parametrize("kind", VALUES)
def test_one_hidden_effect_is_named_alone(kind: str) -> None:
    found = judged(measured(CHAIN, warm_twice(), effect(kind), seed=11))
    assert found.verdict == "missing_effect"
    assert found.selected == (kind,)
    fit = found.fits[(kind,)]
    assert fit.mean_square() == pytest.approx(1.0, abs=0.25)


@pytest.mark.parametrize("seed", range(3))
def test_nothing_is_missing_from_clean_data(seed: int) -> None:
    assert judged(measured(CHAIN, rich(), seed=seed)).verdict == "nothing_missing"


# Each at two or three times the noise: beside a much stronger effect a weak one is taken for its equation's error.
PAIRS = [
    (effect("stiffness", factor=1.05), effect("sensor_bias", bias_rad=0.006)),
    (
        effect("friction_hysteresis", half_width_rad=0.012, break_away_rad=0.01),
        effect("actuation_gain", gain=0.95),
    ),
    (effect("viscoelastic", share=0.1, time_s=12.0), effect("gravity_scale", factor=1.4)),
    (effect("mullins", softening=0.1, scale_rad=0.2), effect("sensor_bias", bias_rad=-0.006)),
]


@pytest.mark.parametrize("pair", PAIRS, ids=lambda pair: "+".join(one.kind for one in pair))
def test_two_hidden_effects_are_both_named(pair: tuple[EffectConfig, EffectConfig]) -> None:
    # a wall's thickness is a stiffness, very nearly
    kinds = [kind for kind in REGISTRY.kinds("effect") if kind != "wall_thickness"]
    found = judged(measured(CHAIN, warm_twice(), *pair, seed=12), kinds=kinds)
    assert found.selected == tuple(sorted(one.kind for one in pair))


def test_effects_of_the_study_are_not_found_again() -> None:
    measurement = measured(CHAIN, rich(), effect("stiffness"), effect("sensor_bias"), seed=1)
    assert judged(measurement, effect("sensor_bias")).selected == ("stiffness",)
    assert judged(measurement, effect("sensor_bias"), effect("stiffness")).verdict == "nothing_missing"


def pressure_of(history: History) -> Array:
    return history.actuation["pressure_pa"]


def test_an_effect_outside_the_list_is_unknown() -> None:
    clean = measured(CHAIN, rich(), seed=2)
    runs = tuple(
        run.with_outputs(
            {
                "angle_rad": run.outputs["angle_rad"]
                + 0.03 * np.sin(run.history.actuation["pressure_pa"] / 800.0)
            }
        )
        for run in clean.runs
    )
    found = judged(Measurement(runs, clean.outputs, "bench.csv"))
    assert found.verdict == "unknown_effect"
    assert max(found.depends_on, key=lambda name: found.depends_on[name]) in (
        "pressure_pa",
        "predicted_angle_rad",
    )


def test_slip_between_repeats_comes_first() -> None:
    found = judged(measured(CHAIN, rich(), effect("stiffness"), offset=0.02, seed=3))
    assert found.verdict == "not_repeatable"
    assert found.next_run is not None
    assert "again" in found.next_run.run


def test_without_repeats_a_clean_model_cannot_be_called_complete() -> None:
    assert judged(measured(CHAIN, rich(1), seed=4)).verdict == "insufficient_data"
    assert judged(measured(CHAIN, rich(1), effect("stiffness"), seed=4)).selected == ("stiffness",)


def test_look_alikes_over_a_narrow_range_are_ambiguous() -> None:
    """No load and little pressure: a soft joint and a strong supply are one and the same."""
    flat = joint(gravity=(0, 0, 0))
    runs = [ramp(f"r{k}", 200.0, 0.5, (3e3, 2e3, 3e3)) for k in range(3)]
    found = judged(measured(flat, runs, effect("stiffness"), seed=5), chain=flat)
    assert found.verdict == "ambiguous"
    named = {kind for kinds in found.judgement.credible for kind in kinds}
    assert {"stiffness", "actuation_gain"} <= named
    assert found.next_run is not None


# -- data as they come --------------------------------------------------------------------------------


def edited(measurement: Measurement, change: Callable[[int, Array], Array]) -> Measurement:
    runs = tuple(
        run.with_outputs({name: change(k, values.copy()) for name, values in run.outputs.items()})
        for k, run in enumerate(measurement.runs)
    )
    return Measurement(runs, measurement.outputs, measurement.source)


STIFF = effect("stiffness")


def test_one_run_only() -> None:
    found = judged(measured(CHAIN, [ramp("a", 500.0, 0.25)], STIFF))
    assert found.verdict != "nothing_missing"
    ratios = [
        h["rmse_over_floor"] for h in diagnosis_json(found)["hypotheses"] if h["rmse_over_floor"] is not None
    ]
    assert max(ratios) < 100  # what is left out is not what nothing is known about


def test_five_samples_twice() -> None:
    runs = [run_of(name, np.arange(5.0), np.linspace(0, P, 5)) for name in "ab"]
    assert judged(measured(CHAIN, runs, STIFF)).verdict == "insufficient_data"


@pytest.mark.parametrize("pressure", [0.0, P])
def test_constant_inputs(pressure: float) -> None:
    runs = [run_of(name, np.arange(60.0), np.full(60, pressure)) for name in "ab"]
    assert judged(measured(CHAIN, runs, STIFF)).verdict in (
        "insufficient_data",
        "ambiguous",
        "nothing_missing",
    )


def test_gaps_in_the_readings() -> None:
    rng = np.random.default_rng(0)
    gaps = edited(measured(CHAIN, rich(), STIFF), lambda _, v: np.where(rng.random(len(v)) < 0.1, np.nan, v))
    assert judged(gaps, kinds=FEW).selected == ("stiffness",)
    blind = edited(measured(CHAIN, rich(), STIFF), lambda k, v: v * np.nan if k in (1, 8) else v)
    assert judged(blind, kinds=FEW).selected == ("stiffness",)
    with pytest.raises(UserError, match="no reading of angle_rad"):
        judged(edited(blind, lambda _, v: v * np.nan))


FEW = ["stiffness", "actuation_gain", "sensor_bias", "mullins"]


@pytest.mark.parametrize("repeats", [1, 2])
def test_computed_data_have_no_noise(repeats: int) -> None:
    found = judged(measured(CHAIN, rich(repeats), STIFF, sigma=0.0), kinds=FEW)
    assert found.selected == ("stiffness",)
    assert any("no noise" in remark for remark in found.remarks)
    clean = judged(measured(CHAIN, rich(repeats), sigma=0.0), kinds=FEW)
    assert clean.verdict == ("nothing_missing" if repeats == 2 else "insufficient_data")


def test_states_without_a_clock() -> None:
    found = judged(measured(CHAIN, [h.with_(time_s=None) for h in rich()], STIFF))
    assert found.selected == ("stiffness",)
    assert {"supply_lag", "viscous_damping", "viscoelastic"} <= set(found.not_excited)


def lost(angle, rate, dt, p, t, old, new, c):  # type: ignore[no-untyped-def]
    return 1e9 if p > c[0] else 0.0


def test_states_without_equilibrium_are_left_out_and_told() -> None:
    measurement = measured(CHAIN, rich(), STIFF)
    found = judged(measurement, chain=CHAIN.with_(terms=(LawTerm("moment", lost, (14e3,)),)), kinds=FEW)
    assert found.selected == ("stiffness",)
    assert any("no equilibrium in" in remark for remark in found.remarks)
    with pytest.raises(NotReachedError, match="bench.csv: the model has no equilibrium in"):
        judged(measurement, chain=CHAIN.with_(terms=(LawTerm("moment", lost, (500.0,)),)))
    with pytest.raises(NotReachedError, match="in any"):
        judged(measurement, chain=CHAIN.with_(terms=(LawTerm("moment", lost, (-1.0,)),)))


@pytest.mark.parametrize("force", [1e3, 1e6])
def test_absurd_loads_in_one_run_name_no_wrong_effect(force: float) -> None:
    measurement = measured(CHAIN, rich(), STIFF)
    runs = list(measurement.runs)
    pulled = runs[0].history.with_(tip_force_n=np.tile([force, 0.0, force], (len(runs[0]), 1)))
    runs[0] = type(runs[0])(pulled, runs[0].outputs, {}, runs[0].cycle, runs[0].lines)
    found = judged(
        Measurement(tuple(runs), measurement.outputs, "bench.csv"), kinds=["stiffness", "sensor_bias"]
    )
    assert found.selected in ((), ("stiffness",))
    assert sum(found.judgement.probability.values()) == pytest.approx(1.0)
    assert all(np.isfinite(p) for p in found.judgement.probability.values())


def test_two_actuators() -> None:
    chain = CHAIN.with_(actuators=(Actuator("pressure_1_pa", 1.0), Actuator("pressure_2_pa", -1.0)))
    runs = []
    for h in rich():
        p = h.actuation["pressure_pa"]
        runs.append(h.with_(actuation={"pressure_1_pa": p, "pressure_2_pa": 0.3 * p[::-1]}))
    assert judged(measured(chain, runs, STIFF), chain=chain).selected == ("stiffness",)


def test_a_tendon() -> None:
    chain = CHAIN.with_(actuators=(Actuator("tendon_force_n", 1.0),))
    runs = [h.with_(actuation={"tendon_force_n": h.actuation["pressure_pa"]}) for h in rich()]
    found = judged(measured(chain, runs, effect("actuation_gain")), chain=chain)
    assert found.selected == ("actuation_gain",)
    assert any("'dead_zone' was left out" in remark for remark in found.remarks)


def test_a_chain_of_22_joints() -> None:
    chain = joint(22)
    outputs = ("angle_rad", "tip_x_m", "marker_3_z_m")
    measurement = measured(chain, rich(), STIFF, outputs=outputs, sigma=SIGMA / 10)
    kinds = ["stiffness", "actuation_gain", "gravity_scale"]
    assert judged(measurement, chain=chain, kinds=kinds).selected == ("stiffness",)


# -- candidates ---------------------------------------------------------------------------------------


def test_one_candidate_is_weighed_against_nothing_and_unknown() -> None:
    measurement = measured(CHAIN, rich(), STIFF)
    assert judged(measurement, kinds=["stiffness"]).selected == ("stiffness",)
    assert judged(measurement, kinds=["stiffness", "stiffness"]).selected == ("stiffness",)
    assert judged(measurement, kinds=["mullins"]).verdict in ("unknown_effect", "ambiguous")
    assert judged(measurement, kinds=[]).verdict == "unknown_effect"


def test_unknown_kinds_are_refused() -> None:
    with pytest.raises(UserError, match="did you mean 'stiffness'"):
        judged(measured(CHAIN, poor()), kinds=["mullins", "stifness"])


def test_each_fit_is_told() -> None:
    told: list[str] = []
    judged(measured(CHAIN, poor()), kinds=["stiffness", "mullins"], tick=told.append)
    assert told[:3] == ["nothing", "stiffness", "mullins"]


@pytest.mark.slow
def test_a_hundred_thousand_samples_in_a_minute() -> None:
    clock = 0.1 * np.arange(50_000)
    pressure = P * (0.5 - 0.5 * np.cos(clock / 9.0))
    measurement = measured(CHAIN, [run_of(name, clock, pressure) for name in "ab"], STIFF)
    started = time.perf_counter()
    found = judged(measurement)
    assert time.perf_counter() - started < 60.0
    assert found.table.n_readings == 100_000
