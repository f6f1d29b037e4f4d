"""The information in runs: effects that are not excited, look-alikes, detectable strengths, the next run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.diagnosis.quick import (
    REGISTRY,
    SIGMA,
    effect,
    joint,
    make_fitter,
    make_predictor,
    measured,
    poor,
    pushes,
    ramp,
    rich,
)

from pliant.diagnosis.candidates import EffectSet
from pliant.diagnosis.diagnosis import diagnose
from pliant.diagnosis.evidence_table import THRESHOLDS
from pliant.diagnosis.excitation import confounded_with, detectable, excitations, not_excited

CHAIN = joint()
FLAT = joint(gravity=(0, 0, 0))
FEW = ["stiffness", "actuation_gain", "sensor_bias", "mullins"]
SOME = ["stiffness", "actuation_gain", "thermal_softening", "viscoelastic", "mullins", "sensor_bias"]


def shown(histories, chain=CHAIN, kinds=SOME):
    fitter = make_fitter(make_predictor(chain, measured(chain, histories)))
    nothing = fitter.fit(EffectSet.from_kinds(REGISTRY, ()))
    return excitations(REGISTRY, fitter, nothing, kinds)


@pytest.mark.slow
def test_without_temperatures_thermal_softening_is_not_excited_and_its_run_is_named() -> None:
    assert not_excited(shown(poor()), THRESHOLDS) == ("thermal_softening",)
    assert not_excited(shown(rich()), THRESHOLDS) == ()
    found = diagnose(make_predictor(CHAIN, measured(CHAIN, poor())), kinds=SOME)
    assert "temperature" in found.not_excited["thermal_softening"]


def test_the_change_equals_the_plausible_end() -> None:
    one = shown(rich(), kinds=["sensor_bias"])["sensor_bias"]
    assert one.snr == pytest.approx(0.05 / SIGMA, rel=1e-6)
    assert one.change == pytest.approx(np.full(len(one.change), np.sign(one.x[0]) * 0.05 / SIGMA))


def test_samples_without_equilibrium_have_no_part_in_the_change() -> None:
    fitter = make_fitter(make_predictor(CHAIN, measured(CHAIN, poor())))
    nothing = fitter.fit(EffectSet.from_kinds(REGISTRY, ()))
    lost = np.arange(len(nothing.residual)) % 3 == 0
    whole = excitations(REGISTRY, fitter, nothing, ["sensor_bias"])["sensor_bias"]
    part = replace(nothing, residual=np.where(lost, np.nan, nothing.residual))
    one = excitations(REGISTRY, fitter, part, ["sensor_bias"])["sensor_bias"]
    assert one.snr == pytest.approx(whole.snr)  # a bias is equal in all conditions
    np.testing.assert_allclose(one.change, np.where(lost, 0.0, whole.change))
    nearly_none = replace(nothing, residual=np.where(np.arange(len(lost)) > 9, np.nan, nothing.residual))
    assert excitations(REGISTRY, fitter, nearly_none, ["sensor_bias"])["sensor_bias"].snr == 0.0


def test_look_alikes_are_so_in_both_directions_and_loads_part_them() -> None:
    narrow = [ramp(f"r{k}", 200.0, 0.5, (3e3, 2e3, 3e3)) for k in range(2)]
    found = confounded_with(shown(narrow, FLAT), {}, 100.0)
    pairs = {(pair.a, pair.b) for pair in found}
    assert {("stiffness", "actuation_gain"), ("actuation_gain", "stiffness")} <= pairs
    assert all(0.0 <= pair.unexplained_share <= 1.0 for pair in found)
    loaded = confounded_with(shown([*narrow, pushes("p", 0.0), pushes("q", 6e3)], FLAT), {}, 100.0)
    assert ("stiffness", "actuation_gain") not in {(pair.a, pair.b) for pair in loaded}


@pytest.fixture(scope="module")
def limits():
    """Return the smallest strengths that clean data would show."""
    clean = measured(CHAIN, rich(), seed=7)
    return {d.kind: d for d in diagnose(make_predictor(CHAIN, clean), kinds=FEW).detectable}


@pytest.mark.parametrize("kind", ["stiffness", "sensor_bias"])
def test_a_detectable_strength_is_identified_and_a_fifth_is_not(kind: str, limits) -> None:
    limit = limits[kind]
    neutral = REGISTRY.get("effect", kind).config_model().fit_parameters()[0].neutral

    def verdict(share: float) -> tuple[str, ...]:
        hidden = effect(kind, **{limit.parameter: neutral + share * (limit.value - neutral)})
        return diagnose(make_predictor(CHAIN, measured(CHAIN, rich(), hidden, seed=7)), kinds=FEW).selected

    assert verdict(3.0) == (kind,)
    assert verdict(0.2) == ()


def test_detectable_strengths_shrink_with_readings() -> None:
    found = shown(rich(), kinds=["stiffness"])
    few, many = detectable(found, 50.0, THRESHOLDS), detectable(found, 5000.0, THRESHOLDS)
    assert abs(few[0].value - 1.0) > 2 * abs(many[0].value - 1.0) > 0
