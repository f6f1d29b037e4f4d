"""The law of a polynomial energy: gradients, its continuation outside the box, its compiled form."""

from dataclasses import replace

import numpy as np
import pytest

from pliant.records.error_bar import ErrorBar
from pliant.records.law import Domain
from pliant_plugins.physics.compiled.laws import law_address
from pliant_plugins.surrogates.polynomial.config import PolynomialConfig
from pliant_plugins.surrogates.polynomial.energy import EnergyBasis
from pliant_plugins.surrogates.polynomial.energy_law import EnergyLaw
from pliant_plugins.surrogates.polynomial.surrogate import Polynomial

BOX = np.array([[0.0, 15e3], [-0.3, 0.3], [-0.2, 0.5], [-0.35, 0.35]])
# c in mJ of x^i v_x^j v_y^k v_z^l, x and v in [−1, 1] on the box: stiff, pressed, softened by p, coupled.
TERMS = {
    (0, 2, 0, 0): 1.0,
    (0, 0, 2, 0): 1.2,
    (0, 0, 0, 2): 0.9,
    (0, 0, 1, 0): -0.3,
    (1, 0, 1, 0): -0.7,
    (1, 0, 2, 0): -0.2,
    (1, 0, 0, 2): -0.15,
    (0, 2, 1, 0): 0.12,
    (0, 0, 1, 2): 0.2,
    (0, 2, 0, 2): -0.1,
    (1, 2, 1, 2): 0.05,
    (2, 0, 3, 0): 0.04,
    (0, 0, 4, 0): 0.1,
    (3, 0, 0, 0): 5.0,
}


def law_of(axes: int) -> EnergyLaw:
    """The sample's law of the axes y, or x and y, or all."""
    keep = {1: [2], 2: [1, 2], 3: [1, 2, 3]}[axes]
    chosen = {t: c for t, c in TERMS.items() if all(t[i] == 0 for i in range(1, 4) if i not in keep)}
    exponents = np.array([[t[0], *(t[i] for i in keep)] for t in chosen])
    maps = np.column_stack([BOX.mean(axis=1), np.ptp(BOX, axis=1) / 2])
    return EnergyLaw(
        EnergyBasis(exponents, maps[0], maps[keep]),
        1e-3 * np.array(list(chosen.values())),
        Domain(BOX[0], BOX[keep]),
        axes=tuple("xyz"[i - 1] for i in keep),
        joint="spherical" if axes == 3 else "revolute",
    )


def points(law: EnergyLaw, n: int, times: float, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Scattered p (n,) and u (n, k), up to `times` half-widths from the box's centre."""
    random = np.random.default_rng(seed).uniform(-times, times, (n, 1 + len(law.axes)))
    box = np.concatenate([law.domain.actuation[None], law.domain.deformation])
    found = box.mean(axis=1) + random * np.ptp(box, axis=1) / 2
    return found[:, 0], found[:, 1:]


@pytest.fixture(params=[1, 2, 3])
def law(request: pytest.FixtureRequest) -> EnergyLaw:
    return law_of(request.param)


def test_inside_the_box_the_law_is_the_polynomial(law: EnergyLaw) -> None:
    p, u = points(law, 50, 1.0)
    k = len(law.axes)
    tau = np.stack(
        [-law.basis.derivative(p, u, (0, *np.eye(k, dtype=int)[i])) @ law.coefficients for i in range(k)], 1
    )
    assert law.evaluate(p, u).tau == pytest.approx(tau, abs=1e-15)


@pytest.mark.parametrize("times", [1.0, 1.3, 5.0])
def test_efforts_and_slopes_are_derivatives_of_the_potential(law: EnergyLaw, times: float) -> None:
    p, u = points(law, 200, times, seed=1)
    effort = law.evaluate(p, u)
    h, dp = 1e-5, 0.5
    for i in range(len(law.axes)):
        step = h * np.eye(len(law.axes))[i]
        slope = (law.potential(p, u + step) - law.potential(p, u - step)) / (2 * h)
        assert effort.tau[:, i] == pytest.approx(-slope, rel=1e-5, abs=1e-9)
        in_u = (law.evaluate(p, u + step).tau - law.evaluate(p, u - step).tau) / (2 * h)
        assert effort.dtau_du[:, :, i] == pytest.approx(in_u, rel=1e-4, abs=1e-7)
    in_p = (law.evaluate(p + dp, u).tau - law.evaluate(p - dp, u).tau) / (2 * dp)
    assert effort.dtau_dp == pytest.approx(in_p, rel=1e-4, abs=1e-12)
    assert np.array_equal(effort.dtau_du, np.swapaxes(effort.dtau_du, 1, 2))


def test_the_potential_is_zero_at_rest_under_any_pressure(law: EnergyLaw) -> None:
    p, u = points(law, 20, 3.0)
    assert np.array_equal(law.potential(p, np.zeros_like(u)), np.zeros(20))


def test_efforts_and_slopes_are_continuous_across_every_side_of_the_box(law: EnergyLaw) -> None:
    """C¹: on both sides of a face, other coordinates inside and outside, τ and all slopes agree."""
    box = np.concatenate([law.domain.actuation[None], law.domain.deformation])
    for side in range(len(box)):
        for border in box[side]:
            p, u = points(law, 40, 1.6, seed=2)
            at = np.column_stack([p, u])
            at[:, side] = border
            gap = 1e-9 * np.ptp(box[side])
            low, high = (
                law.evaluate((at + d)[:, 0], (at + d)[:, 1:])
                for d in (-gap * _one(side, at), gap * _one(side, at))
            )
            for name in ("tau", "dtau_dp", "dtau_du"):
                values = getattr(low, name)
                assert getattr(high, name) == pytest.approx(values, rel=1e-6, abs=1e-6 * np.abs(values).max())


def _one(side: int, like: np.ndarray) -> np.ndarray:
    return np.eye(like.shape[1])[side]


def test_stable_and_finite_far_outside(law: EnergyLaw) -> None:
    """Half of the smallest stiffness in the box remains up to 3 × p and 5 × u; τ opposes what leaves the box."""
    _, inside = points(law, 2000, 1.0)
    p, u = points(law, 4000, 5.0, seed=3)
    p = np.random.default_rng(5).uniform(-15e3, 45e3, len(p))
    at_box = np.linalg.eigvalsh(-law.evaluate(points(law, 2000, 1.0)[0], inside).dtau_du).min()
    stiffness = np.linalg.eigvalsh(-law.evaluate(p, u).dtau_du)
    assert at_box > 0
    assert stiffness.min() > 0.2 * at_box
    box = law.domain.deformation
    outside = (p < 0) | (p > 15e3) | np.any((u < box[:, 0]) | (u > box[:, 1]), axis=1)
    assert np.array_equal(np.any(law.domain.excess(p, u) != 0, axis=1), outside)
    assert np.isfinite(law.evaluate(np.array([1e9]), np.full((1, len(law.axes)), 1e3)).tau).all()


def test_where_bowls_help_no_axis_that_is_inside_coupling_ends_sooner() -> None:
    """x softens with y's excess: at the first reach it is unstable, whatever the bowls; half of its stiffness remains.

    Π = ½ x² + 50 y² − 0.45 x² y² on |x| ≤ 1, 0 ≤ y ≤ 1 has ∂²Π/∂x² = 1 − 0.9 y²: negative from y = 1.05 on.
    """
    exponents = np.array([[0, 2, 0], [0, 0, 2], [0, 2, 2]])
    unit_maps = np.array([[0.0, 1.0], [0.0, 1.0]])
    basis = EnergyBasis(exponents, np.array([0.0, 1.0]), unit_maps)
    domain = Domain(np.array([0.0, 1.0]), np.array([[-1.0, 1.0], [-1e-3, 1.0]]))
    law = EnergyLaw(basis, np.array([0.5, 50.0, -0.45]), domain, axes=("x", "y"))
    y = np.linspace(1.0, 6.0, 200)
    for x in (0.0, 1.0):
        slopes = law.evaluate(np.zeros(200), np.column_stack([np.full(200, x), y])).dtau_du
        stiffness = np.linalg.eigvalsh(-slopes).min(axis=1)
        assert stiffness.min() > 0.45 * stiffness[0] > 0.02


def test_a_continuation_takes_milliseconds(monkeypatch: pytest.MonkeyPatch) -> None:
    """A design search makes thousands of laws: the places that are looked at are few."""
    from pliant_plugins.surrogates.polynomial import energy_continuation

    seen: list[int] = []
    evaluate = energy_continuation.energy_kernel.evaluate

    def counted(p: np.ndarray, u: np.ndarray, parameters: np.ndarray) -> np.ndarray:
        seen.append(len(p))
        return evaluate(p, u, parameters)

    monkeypatch.setattr(energy_continuation.energy_kernel, "evaluate", counted)
    law = law_of(3)
    box = np.concatenate([law.domain.actuation[None], law.domain.deformation])
    energy_continuation.continuation(law.basis, law.coefficients, box)
    assert sum(seen) < 2500


def test_closed_loops_create_no_energy() -> None:
    """∮ τ·du + ∮ V dp = 0 with V = −∂Π/∂p, on a loop that leaves the box in p and in every u."""
    law = law_of(3)
    t = np.linspace(0, 2 * np.pi, 20001)[:-1]
    p = 9e3 + 12e3 * np.sin(t)
    u = np.stack([0.5 * np.cos(t), 0.15 + 0.6 * np.sin(t + 1), 0.5 * np.sin(2 * t)], 1)
    dt = t[1] - t[0]
    rates = [np.stack([-0.5 * np.sin(t), 0.6 * np.cos(t + 1), np.cos(2 * t)], 1), 12e3 * np.cos(t)]
    by_u = np.sum(law.evaluate(p, u).tau * rates[0]) * dt
    by_p = -np.sum((law.potential(p + 0.5, u) - law.potential(p - 0.5, u)) * rates[1]) * dt
    assert abs(by_u) > 1e-5
    assert by_u + by_p == pytest.approx(0, abs=1e-9 * np.abs(law.evaluate(p, u).tau).max() + 1e-5 * abs(by_u))


def test_the_scalar_form_gives_the_same(law: EnergyLaw) -> None:
    """Interpreted and compiled, inside and outside."""
    p, u = points(law, 60, 2.5, seed=4)
    k = len(law.axes)
    scalar = law.scalar()
    wanted = law.evaluate(p, u)
    assert law_address(scalar.function) != 0
    for n in range(60):
        tau, gain, slope = np.full(k, np.nan), np.full(k, np.nan), np.full((k, k), np.nan)
        scalar.function(p[n], u[n], scalar.parameters, tau, gain, slope)
        for got, name in ((tau, "tau"), (gain, "dtau_dp"), (slope, "dtau_du")):
            expected = getattr(wanted, name)[n]
            assert got == pytest.approx(expected, rel=1e-12, abs=1e-13 * np.abs(expected).max())


def test_a_record_gives_the_same_bits_and_the_error_bar(law: EnergyLaw) -> None:
    p, u = points(law, 30, 2.0)
    box = np.concatenate([law.domain.actuation[None], law.domain.deformation])
    inside = points(law, 12, 1.0)
    misses = np.random.default_rng(0).normal(0, 1e-5, (12, len(law.axes)))
    law = replace(law, error=ErrorBar.of(box, *inside, misses))
    again = Polynomial(PolynomialConfig()).load(law.record())
    assert isinstance(again, EnergyLaw)
    assert np.array_equal(again.evaluate(p, u).tau, law.evaluate(p, u).tau)
    assert np.array_equal(again.band(p, u), law.band(p, u))  # type: ignore[arg-type]
    assert (again.axes, again.joint, again.actuation_name) == (law.axes, law.joint, law.actuation_name)


def test_a_law_without_limits_is_the_polynomial_everywhere() -> None:
    law = replace(law_of(3), domain=Domain.unbounded(3))
    p, u = points(law_of(3), 30, 4.0)
    bare = -law.basis.derivative(p, u, (0, 0, 1, 0)) @ law.coefficients
    assert law.evaluate(p, u).tau[:, 1] == pytest.approx(bare, rel=1e-12)
