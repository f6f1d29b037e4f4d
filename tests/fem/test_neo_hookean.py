"""The neo-Hookean law: derivatives, objectivity, small-strain limit."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

from pliant_plugins.materials.neo_hookean import NeoHookean, NeoHookeanConfig

MU, NU = 240e3, 0.49


@pytest.fixture
def law() -> NeoHookean:
    return NeoHookean(NeoHookeanConfig(shear_modulus_pa=MU, poisson_ratio=NU))


@pytest.fixture(name="F")
def deformations() -> np.ndarray:
    rng = np.random.default_rng(0)
    return np.eye(3) + 0.15 * rng.standard_normal((4, 5, 3, 3))


def test_stress_is_the_energy_s_slope(law: NeoHookean, F: np.ndarray) -> None:
    rng = np.random.default_rng(1)
    d, h = rng.standard_normal(F.shape), 1e-6
    slope = (law.energy(F + h * d) - law.energy(F - h * d)) / (2 * h)
    assert np.allclose(np.sum(law.evaluate(F).stress * d, axis=(-2, -1)), slope, rtol=1e-7, atol=1e-3)


def test_tangent_is_the_stress_s_slope_and_symmetric(law: NeoHookean, F: np.ndarray) -> None:
    rng = np.random.default_rng(2)
    d, h = rng.standard_normal(F.shape), 1e-6
    slope = (law.evaluate(F + h * d).stress - law.evaluate(F - h * d).stress) / (2 * h)
    A = law.evaluate(F).tangent
    assert np.allclose(np.einsum("...ijkl,...kl->...ij", A, d), slope, rtol=1e-6, atol=1e-2)
    matrix = A.reshape(4, 5, 9, 9)
    assert np.allclose(matrix, np.swapaxes(matrix, -1, -2))


def test_energy_and_evaluate_agree(law: NeoHookean, F: np.ndarray) -> None:
    assert np.allclose(law.energy(F), law.evaluate(F).energy, rtol=1e-14)


def test_rotation_costs_nothing_and_turns_the_stress(law: NeoHookean, F: np.ndarray) -> None:
    Q = np.linalg.qr(np.random.default_rng(3).standard_normal((3, 3)))[0]
    Q = Q * np.sign(np.linalg.det(Q))
    assert np.allclose(law.energy(Q @ F), law.energy(F), rtol=1e-12)
    assert np.allclose(law.evaluate(Q @ F).stress, Q @ law.evaluate(F).stress, rtol=1e-9, atol=1e-6)


def test_rest_is_stress_free_with_hooke_s_moduli(law: NeoHookean) -> None:
    rest = law.evaluate(np.eye(3))
    assert rest.energy == pytest.approx(0, abs=1e-9)
    assert np.allclose(rest.stress, 0, atol=1e-9)
    lame = 2 * MU * NU / (1 - 2 * NU)
    assert rest.tangent[0, 1, 0, 1] == pytest.approx(MU)
    assert rest.tangent[0, 0, 1, 1] == pytest.approx(lame)
    assert rest.tangent[0, 0, 0, 0] == pytest.approx(lame + 2 * MU)


def test_uniaxial_stress_of_the_incompressible_limit() -> None:
    """P = μ (λ − λ⁻²) of an incompressible bar, with the lateral stretch that frees its sides."""
    law = NeoHookean(NeoHookeanConfig(shear_modulus_pa=MU, poisson_ratio=0.4995))
    for stretch in (0.7, 1.5, 2.0):
        side = stretch**-0.5
        for _ in range(60):  # fixed-point steps towards a stress-free side
            result = law.evaluate(np.diag([stretch, side, side]))
            side -= result.stress[1, 1] / (result.tangent[1, 1, 1, 1] + result.tangent[1, 1, 2, 2])
        assert result.stress[1, 1] == pytest.approx(0, abs=1e-3)
        assert result.stress[0, 0] == pytest.approx(MU * (stretch - stretch**-2), rel=5e-3)


@pytest.mark.parametrize("bad", [{"shear_modulus": 0}, {"shear_modulus": 1e5, "poisson_ratio": 0.5}])
def test_impossible_constants_are_refused(bad: dict[str, float]) -> None:
    with pytest.raises(ValidationError):
        NeoHookeanConfig.model_validate(bad)
