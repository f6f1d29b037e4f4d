"""The third source of truth: a rod in MuJoCo that has the study's equilibria and moves as a rod does."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks.evidence.protocols import LOAD_N_M, Run, steps, triangles
from benchmarks.evidence.robots import GRAVITY_M_S2, PRESSURE_MAX_PA, ROD, Array
from benchmarks.evidence.rod_truth import ARM_M, CHANGES, PULL_N, STIFFNESS_N_M, Rod, fitted, follow
from benchmarks.evidence.sets import SetSpec, make_set, signal
from scipy.optimize import brentq
from tests.slow import slow_among


def angle(run: Run, **changes: float) -> Array:
    return follow((run,), Rod(**changes))[0]["angle_rad"]


def held(share: float, load: float = 0.0, pitch: float = 0.0) -> Run:
    n = np.ones(20)
    return Run(
        "held", "A", share * PRESSURE_MAX_PA * n, load * LOAD_N_M * n, base_angles_rad=(0.0, pitch, 0.0)
    )


def test_a_rod_without_weight_turns_by_its_moment_over_its_stiffness() -> None:
    sideways = Run("held", "A", np.zeros(20), np.full(20, -LOAD_N_M), base_angles_rad=(np.pi / 2, 0.0, 0.0))
    assert angle(sideways)[-1] == pytest.approx(LOAD_N_M / STIFFNESS_N_M, rel=1e-4)
    softer = angle(sideways, rod_stiffness=-0.2)[-1]
    assert softer == pytest.approx(LOAD_N_M / STIFFNESS_N_M / 0.8, rel=1e-4)
    pulled = Run(
        "held", "A", np.full(20, 0.02 * PRESSURE_MAX_PA), np.zeros(20), base_angles_rad=(np.pi / 2, 0.0, 0.0)
    )
    assert angle(pulled)[-1] == pytest.approx(0.02 * PULL_N * ARM_M / STIFFNESS_N_M, rel=0.02)


def test_the_study_given_away_is_the_clean_rod_at_rest() -> None:
    law, mass = fitted()
    assert ROD.law == pytest.approx(law, rel=1e-3) and ROD.mass_kg == pytest.approx(mass, rel=1e-4)
    k_n, m_a, m_e, b_e = law
    sigma = 0.02 * 0.8
    for share, load, pitch in ((1.0, 0.0, 0.0), (0.5, 1.0, 0.0), (0.3, -1.0, 0.0), (0.7, 0.0, np.pi / 2)):

        def balance(u: float) -> float:
            p = share * PRESSURE_MAX_PA  # noqa: B023 - called at once
            weight = 0.5 * mass * GRAVITY_M_S2 * ROD.length_m / 4 * np.sin(u - pitch)  # noqa: B023
            return k_n * p + m_a * p * u - m_e * u * abs(u) / 2 - b_e * u - load * LOAD_N_M - weight  # noqa: B023

        assert angle(held(share, load, pitch))[-1] == pytest.approx(brentq(balance, -1, 2), abs=0.2 * sigma)


def test_a_rod_is_late_drags_and_stops_as_its_fields_say() -> None:
    ramp = Run("ramp", "A", PRESSURE_MAX_PA * np.linspace(0, 0.2, 51), np.zeros(51))
    plain = angle(ramp)
    for late in ({"rod_lag_s": 0.8}, {"rod_damping_s": 0.8}):
        assert angle(ramp, **late)[40] == pytest.approx(plain[38], rel=0.05)
    cycle = Run("cycle", "A", triangles(40, [0.5, 0.5]), np.zeros(200))
    loop = angle(cycle, rod_friction_n_m=1e-3)
    up, down = loop[120], loop[180]  # the same pressure, rising and falling
    assert cycle.pressure_pa[120] == pytest.approx(cycle.pressure_pa[180])
    assert down - up == pytest.approx(2e-3 / STIFFNESS_N_M, rel=0.3)
    top = Run("top", "A", PRESSURE_MAX_PA * steps((0.4, 1.0), 8.0), np.zeros(40))
    free, stopped = angle(top), angle(top, rod_stop=0.3, rod_limit_rad=0.5)
    assert stopped[15] == pytest.approx(free[15], abs=1e-4) and free[-1] - stopped[-1] > 0.03


@pytest.mark.parametrize("kind", slow_among(sorted(CHANGES), *sorted(CHANGES)[2:]))
def test_effects_on_a_rod_reach_their_strength(kind: str) -> None:
    made = make_set(SetSpec(kind, 3, "rod", "rod", "coarse", snr=1.7))
    assert signal(made.clean, made.hidden, made.sigma) == pytest.approx(1.7, rel=0.05)
    assert "k_n" in made.study and made.label["forms"] == ["a rod in MuJoCo"]
    with pytest.raises(ValueError, match="no truth"):
        make_set(SetSpec("mullins", 3, "rod", "rod", "coarse"))
