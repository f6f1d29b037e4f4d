"""From measurements to a verdict: single effects, pairs, no effect, and data with the usual defects of a bench."""

from __future__ import annotations

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
    make_history,
    make_predictor,
    measured,
    poor,
    ramp,
    rich,
)
from tests.slow import slow_among

from pliant.diagnosis.diagnosis import Diagnosis, diagnose, explanation
from pliant.errors import NotReachedError, UserError
from pliant.interfaces.effect import EffectConfig
from pliant.records.chain import Actuator, ChainModel
from pliant.records.design import Array
from pliant.records.measurement import Measurement
from pliant.records.term import LawTerm
from pliant.report.diagnosis import diagnosis_json

CHAIN = joint()
STIFF = effect("stiffness")
FEW = ["stiffness", "actuation_gain", "sensor_bias", "mullins"]


def judged(
    measurement: Measurement, *study: EffectConfig, chain: ChainModel = CHAIN, **more: object
) -> Diagnosis:
    """Return the diagnosis; every sentence and number of it must be printable."""
    found = diagnose(make_predictor(chain, measurement, *study), **more)  # type: ignore[arg-type]
    values = diagnosis_json(found)
    assert sum(h["probability"] for h in values["hypotheses"]) == pytest.approx(1.0)
    words = [found.judgement.sentence, *explanation(found, REGISTRY), *found.remarks]
    assert all(text and "nan" not in text.split() for text in words)
    return found


@pytest.fixture(scope="module")
def stiff() -> Measurement:
    return measured(CHAIN, rich(), STIFF)


@pytest.fixture(scope="module")
def twice():
    """Return the rich protocol at two temperatures, since an effect in a single condition cannot be cross-checked."""
    more = [ramp(f"hot{k}", 3e3, 0.5, specimen="AB"[k], temperature_c=47.0) for k in range(2)]
    over = [ramp(f"over{k}", 3e3, 0.5, specimen="AB"[k], base_angles_rad=[0.0, np.pi, 0.0]) for k in range(2)]
    return [*rich(), *more, *over]


# Five kinds of every place represent these in the fast suite.
REST = [
    "pressure_offset",
    "dead_zone",
    "viscous_damping",
    "permanent_set",
    "self_contact",
    "thermal_softening",
    "viscoelastic",
    "supply_lag",
]


@pytest.mark.parametrize("kind", slow_among(VALUES, *REST, "gravity_scale"))
def test_one_hidden_effect_is_named_alone(kind: str, twice) -> None:
    measurement = measured(CHAIN, twice, effect(kind), seed=11)
    found = judged(measurement, kinds=sorted({*FEW, "viscous_damping", kind}))  # four represent the others
    assert (found.verdict, found.selected) == ("missing_effect", (kind,))
    # χ² of coloured noise: its squares are correlated by φ², here 0.36
    free = found.table.n_readings * (1 - 0.36) / (1 + 0.36)
    square = found.fits[(kind,)].mean_square() * (found.scales["angle_rad"] / SIGMA) ** 2
    assert square == pytest.approx(1.0, abs=3 * np.sqrt(2 / free))


@pytest.mark.parametrize("seed", slow_among(range(3), 2))
def test_nothing_is_missing_from_clean_data(seed: int) -> None:
    kinds = FEW if seed else None  # once among all effects
    assert judged(measured(CHAIN, rich(), seed=seed), kinds=kinds).verdict == "nothing_missing"


# Each at two or three times the noise: next to a much stronger effect a weak one is taken for its equation's error.
PAIRS = [
    {"stiffness": {"factor": 1.05}, "sensor_bias": {"bias_rad": 0.006}},
    {
        "friction_hysteresis": {"half_width_rad": 0.012, "break_away_rad": 0.01},
        "actuation_gain": {"gain": 0.95},
    },
    {"viscoelastic": {"share": 0.1, "time_s": 12.0}, "gravity_scale": {"factor": 1.4}},
    {"mullins": {"softening": 0.1, "scale_rad": 0.2}, "sensor_bias": {"bias_rad": -0.006}},
]


@pytest.mark.parametrize("pair", slow_among(PAIRS, *PAIRS[1:]), ids="+".join)
def test_two_hidden_effects_are_both_named(pair, twice) -> None:
    hidden = [effect(kind, **values) for kind, values in pair.items()]
    found = judged(measured(CHAIN, twice, *hidden, seed=12), kinds=[*{*FEW, *pair}])
    assert found.selected == tuple(sorted(pair))


def test_effects_in_the_study_are_not_identified_again() -> None:
    measurement = measured(CHAIN, rich(), STIFF, effect("sensor_bias"), seed=1)
    assert judged(measurement, effect("sensor_bias"), kinds=FEW).selected == ("stiffness",)
    assert judged(measurement, effect("sensor_bias"), STIFF, kinds=FEW).verdict == "nothing_missing"


def edited(measurement: Measurement, change: Callable[[int, Array], Array]) -> Measurement:
    runs = tuple(
        run.with_outputs({name: change(k, values.copy()) for name, values in run.outputs.items()})
        for k, run in enumerate(measurement.runs)
    )
    return Measurement(runs, measurement.outputs, measurement.source)


def test_an_effect_outside_the_list_is_unknown() -> None:
    clean = measured(CHAIN, rich(), seed=2)
    pressure = [run.history.actuation["pressure_pa"] for run in clean.runs]
    found = judged(edited(clean, lambda k, v: v + 0.03 * np.sin(pressure[k] / 800.0)), kinds=FEW)
    assert found.verdict == "unknown_effect"
    assert max(found.depends_on, key=found.depends_on.__getitem__) in ("pressure_pa", "predicted_angle_rad")


def test_slip_between_repeats_comes_first() -> None:
    found = judged(measured(CHAIN, rich(), STIFF, offset=0.02, seed=3), kinds=FEW)
    assert found.verdict == "not_repeatable"
    assert found.next_run is not None and "again" in found.next_run.run


@pytest.mark.slow
def test_without_repeats_a_clean_model_cannot_be_called_complete() -> None:
    assert judged(measured(CHAIN, rich(1), seed=4)).verdict == "insufficient_data"
    assert judged(measured(CHAIN, rich(1), STIFF, seed=4), kinds=FEW).selected == ("stiffness",)


def test_look_alikes_over_a_narrow_range_are_ambiguous() -> None:
    """Without load and at low pressure a soft joint and a strong supply have the same readings."""
    flat = joint(gravity=(0, 0, 0))
    runs = [ramp(f"r{k}", 200.0, 0.5, (3e3, 2e3, 3e3)) for k in range(3)]
    found = judged(measured(flat, runs, STIFF, seed=5), chain=flat, kinds=FEW)
    assert found.verdict == "ambiguous" and found.next_run is not None
    named = {kind for kinds in found.judgement.credible for kind in kinds}
    assert {"stiffness", "actuation_gain"} <= named


# -- data with defects --------------------------------------------------------------------------------


def test_one_run_only() -> None:
    found = judged(measured(CHAIN, [ramp("a", 500.0, 0.25)], STIFF), kinds=FEW)
    assert found.verdict != "nothing_missing"
    ratios = [h["rmse_over_floor"] for h in diagnosis_json(found)["hypotheses"]]
    assert (
        max(ratio for ratio in ratios if ratio is not None) < 100
    )  # with one run left out, the others still predict it


LITTLE = ("insufficient_data", "ambiguous", "nothing_missing")


@pytest.mark.parametrize(
    ("pressure", "verdicts"),
    [(np.linspace(0, P, 5), LITTLE[:1]), (np.zeros(60), LITTLE), (np.full(60, P), LITTLE)],
    ids=["five samples", "at rest", "at one level"],
)
def test_runs_that_tell_little(pressure, verdicts) -> None:
    runs = [make_history(name, np.arange(float(len(pressure))), pressure) for name in "ab"]
    assert judged(measured(CHAIN, runs, STIFF), kinds=FEW).verdict in verdicts


def test_gaps_in_the_readings(stiff) -> None:
    rng = np.random.default_rng(0)
    gaps = edited(stiff, lambda _, v: np.where(rng.random(len(v)) < 0.1, np.nan, v))
    assert judged(gaps, kinds=FEW).selected == ("stiffness",)
    blind = edited(stiff, lambda k, v: v * np.nan if k in (1, 8) else v)
    assert judged(blind, kinds=FEW).selected == ("stiffness",)
    with pytest.raises(UserError, match="no reading of angle_rad"):
        judged(edited(blind, lambda _, v: v * np.nan))


@pytest.mark.parametrize("repeats", [1, 2])
def test_computed_data_have_no_noise(repeats: int) -> None:
    found = judged(measured(CHAIN, rich(repeats), STIFF, sigma=0.0), kinds=FEW)
    assert found.selected == ("stiffness",)
    assert any("no noise" in remark for remark in found.remarks)
    clean = judged(measured(CHAIN, rich(repeats), sigma=0.0), kinds=FEW)
    assert clean.verdict == ("nothing_missing" if repeats == 2 else "insufficient_data")


def test_states_without_a_clock() -> None:
    lags = ("supply_lag", "viscous_damping", "viscoelastic")
    states = measured(CHAIN, [h.with_(time_s=None) for h in rich()], STIFF)
    found = judged(states, kinds=[*FEW, *lags])
    assert found.selected == ("stiffness",)
    assert set(lags) <= set(found.not_excited)


def lost(angle, rate, dt, p, t, old, new, c):  # type: ignore[no-untyped-def]
    return 1e9 if p > c[0] else 0.0


def test_states_without_equilibrium_are_left_out_and_told(stiff) -> None:
    def above(pressure_pa: float, **more: object) -> Diagnosis:
        return judged(stiff, chain=CHAIN.with_(terms=(LawTerm("moment", lost, (pressure_pa,)),)), **more)

    found = above(14e3, kinds=FEW)
    assert found.selected == ("stiffness",)
    assert any("no equilibrium in" in remark for remark in found.remarks)
    with pytest.raises(NotReachedError, match="bench.csv: the model has no equilibrium in"):
        above(500.0)
    with pytest.raises(NotReachedError, match="in any"):
        above(-1.0)


@pytest.mark.parametrize("force", slow_among([1e3, 1e6], 1e3))
def test_absurd_loads_in_one_run_name_no_wrong_effect(force: float, stiff) -> None:
    first, *runs = stiff.runs
    pulled = first.history.with_(tip_force_n=np.tile([force, 0.0, force], (len(first), 1)))
    first = type(first)(pulled, first.outputs, {}, first.cycle, first.lines)
    found = judged(Measurement((first, *runs), stiff.outputs, "bench.csv"), kinds=FEW[::2])
    assert found.selected in ((), ("stiffness",))
    assert sum(found.judgement.probability.values()) == pytest.approx(1.0)
    assert all(np.isfinite(p) for p in found.judgement.probability.values())


def test_two_actuators_and_a_tendon() -> None:
    chain = CHAIN.with_(actuators=(Actuator("pressure_1_pa", 1.0), Actuator("pressure_2_pa", -1.0)))
    pressures = [h.actuation["pressure_pa"] for h in rich()]
    driven = [{"pressure_1_pa": p, "pressure_2_pa": 0.3 * p[::-1]} for p in pressures]
    runs = [h.with_(actuation=inputs) for h, inputs in zip(rich(), driven, strict=True)]
    assert judged(measured(chain, runs, STIFF), chain=chain, kinds=FEW).selected == ("stiffness",)
    chain = CHAIN.with_(actuators=(Actuator("tendon_force_n", 1.0),))
    runs = [h.with_(actuation={"tendon_force_n": p}) for h, p in zip(rich(), pressures, strict=True)]
    found = judged(measured(chain, runs, effect("actuation_gain")), chain=chain, kinds=[*FEW, "dead_zone"])
    assert found.selected == ("actuation_gain",)
    assert any("'dead_zone' was left out" in remark for remark in found.remarks)


def test_a_chain_with_22_joints() -> None:
    chain = joint(22)
    outputs = ("angle_rad", "tip_x_m", "marker_3_z_m")
    measurement = measured(chain, rich(1), STIFF, outputs=outputs, sigma=SIGMA / 10)
    kinds = ["stiffness", "actuation_gain", "gravity_scale"]
    assert judged(measurement, chain=chain, kinds=kinds).selected == ("stiffness",)


# -- candidates ---------------------------------------------------------------------------------------


def test_one_candidate_is_weighed_against_nothing_and_unknown(stiff) -> None:
    assert judged(stiff, kinds=["stiffness", "stiffness"]).selected == ("stiffness",)
    assert judged(stiff, kinds=["mullins"]).verdict in ("unknown_effect", "ambiguous")
    assert judged(stiff, kinds=[]).verdict == "unknown_effect"


def test_each_fit_is_told_and_unknown_kinds_are_refused() -> None:
    told: list[str] = []
    measurement = measured(CHAIN, poor())
    judged(measurement, kinds=["stiffness", "mullins"], tick=told.append)
    assert told[:3] == ["nothing", "stiffness", "mullins"]
    with pytest.raises(UserError, match="did you mean 'stiffness'"):
        judged(measurement, kinds=["mullins", "stifness"])


@pytest.mark.slow
def test_a_hundred_thousand_samples_are_weighed() -> None:
    """The time that this takes is measured by benchmarks.evidence.speed."""
    clock = 0.1 * np.arange(50_000)
    pressure = P * (0.5 - 0.5 * np.cos(clock / 9.0))
    measurement = measured(CHAIN, [make_history(name, clock, pressure) for name in "ab"], STIFF)
    found = judged(measurement, kinds=["stiffness", "sensor_bias"])
    assert 2_000 < found.table.n_readings < 12_000  # chosen by the samples that carry information
    assert any("The recording is long: of 100000 samples" in remark for remark in found.remarks)
    assert found.selected == ("stiffness",)
