"""Every material: derivatives, objectivity, Hooke's limit, closed forms of incompressible bars, refusals, stability."""

from __future__ import annotations

import numpy as np
import pytest

from pliant.interfaces.material import Material
from pliant.mechanics.homogeneous import falling_stretches, nominal_stress
from pliant.registry.discovery import discover

REGISTRY = discover()
MU = 240e3
F = np.eye(3) + 0.2 * np.random.default_rng(1).uniform(-1, 1, (5, 4, 3, 3))


def law(kind: str, **keys: object) -> Material:
    component = REGISTRY.get("material", kind)
    return component.build(component.config_model().model_validate({"kind": kind, **keys}))


LAWS = {
    "neo_hookean": {"shear_modulus": MU},
    "mooney_rivlin": {"c10": 90e3, "c01": 30e3},
    "yeoh": {"c10": 120e3, "c20": -4e3, "c30": 1.5e3},
    "ogden": {"mu": [200e3, 40e3], "alpha": [1.8, -2.5]},
}


REDUCTIONS = {
    "mooney_rivlin": {"c10": MU / 2, "c01": 0},
    "yeoh": {"c10": MU / 2},
    "ogden": {"mu": [MU], "alpha": [2]},
}


@pytest.mark.parametrize("kind", REDUCTIONS)
def test_laws_reduce_to_neo_hookean(kind: str) -> None:
    got, wanted = law(kind, **REDUCTIONS[kind]).evaluate(F), law("neo_hookean", shear_modulus=MU).evaluate(F)
    scale = np.abs(wanted.tangent).max()
    np.testing.assert_allclose(got.energy, wanted.energy, rtol=1e-10, atol=1e-12 * scale)
    np.testing.assert_allclose(got.stress, wanted.stress, atol=1e-11 * scale)
    np.testing.assert_allclose(got.tangent, wanted.tangent, atol=1e-11 * scale)


def test_ogden_with_powers_2_and_minus_2_is_mooney_rivlin() -> None:
    mooney = law("mooney_rivlin", c10=90e3, c01=30e3).evaluate(F)
    ogden = law("ogden", mu=[180e3, 60e3], alpha=[2, -2]).evaluate(F)
    np.testing.assert_allclose(ogden.energy, mooney.energy, rtol=1e-9)
    np.testing.assert_allclose(ogden.tangent, mooney.tangent, atol=1e-10 * np.abs(mooney.tangent).max())


def test_ogden_does_not_depend_on_which_eigenvectors_equal_stretches_get() -> None:
    """At nearly equal stretches, turned at random, P and A are those of a Mooney–Rivlin solid."""
    rng = np.random.default_rng(7)
    mooney, ogden = law("mooney_rivlin", c10=90e3, c01=30e3), law("ogden", mu=[180e3, 60e3], alpha=[2, -2])
    for gap in (0.0, 1e-15, 1e-11, 1e-7, 1e-4):
        Q, R = (np.linalg.qr(rng.standard_normal((3, 3)))[0] for _ in range(2))
        turned = Q @ np.diag([1.3, 1.3 * (1 + gap), 1.3 * (1 - gap)]) @ R
        turned = turned * np.sign(np.linalg.det(turned))
        got, wanted = ogden.evaluate(turned), mooney.evaluate(turned)
        assert np.abs(got.tangent - wanted.tangent).max() < 1e-9 * np.abs(wanted.tangent).max(), gap
        assert np.abs(got.stress - wanted.stress).max() < 1e-9 * np.abs(wanted.stress).max(), gap


# Nominal stresses of incompressible solids (Holzapfel 2000, §6.5; Treloar 1975, ch. 5).
STRETCH = np.array([0.6, 0.9, 1.3, 2.0, 2.4])
FORMS = {
    "uniaxial": (
        STRETCH - STRETCH**-2,
        STRETCH**2 + 2 / STRETCH,
        lambda a: STRETCH ** (a - 1) - STRETCH ** (-a / 2 - 1),
    ),
    "equibiaxial": (
        STRETCH - STRETCH**-5,
        2 * STRETCH**2 + STRETCH**-4,
        lambda a: STRETCH ** (a - 1) - STRETCH ** (-2 * a - 1),
    ),
    "planar": (
        STRETCH - STRETCH**-3,
        STRETCH**2 + STRETCH**-2 + 1,
        lambda a: STRETCH ** (a - 1) - STRETCH ** (-a - 1),
    ),
}


@pytest.mark.parametrize("mode", FORMS)
@pytest.mark.parametrize("kind", LAWS)
def test_homogeneous_tests_have_their_closed_forms(kind: str, mode: str) -> None:
    shape, I1, power = FORMS[mode]
    c10, c01, c20, c30 = 90e3, 30e3, -2e3, 500.0
    second = {"uniaxial": 1 / STRETCH, "equibiaxial": STRETCH**2, "planar": np.ones(5)}[mode]
    keys, wanted = {
        "neo_hookean": ({"shear_modulus": 2 * c10}, 2 * shape * c10),
        "mooney_rivlin": ({"c10": c10, "c01": c01}, 2 * shape * (c10 + c01 * second)),
        "yeoh": (
            {"c10": c10, "c20": c20, "c30": c30},
            2 * shape * (c10 + 2 * c20 * (I1 - 3) + 3 * c30 * (I1 - 3) ** 2),
        ),
        "ogden": (
            {"mu": [2e5, 4e4], "alpha": [1.8, -2.5]},
            2 * 2e5 / 1.8 * power(1.8) + 2 * 4e4 / -2.5 * power(-2.5),
        ),
    }[kind]
    soft, stiff = (
        nominal_stress(law(kind, poisson_ratio=poisson, **keys), STRETCH, mode) for poisson in (0.499, 0.4995)
    )
    assert not np.allclose(stiff, wanted, rtol=1e-4)
    # the contribution of compressibility scales with 1/K, and K doubles from one to the other
    np.testing.assert_allclose(2 * stiff - soft, wanted, rtol=5e-3)


@pytest.mark.parametrize(
    ("kind", "keys", "says"),
    [
        ("neo_hookean", {"shear_modulus": 0}, "greater than 0"),
        ("neo_hookean", {"shear_modulus": 1e5, "poisson_ratio": 0.5}, "less than or equal to 0.4995"),
        ("mooney_rivlin", {"c10": 1e5, "c01": -1e5}, "2 \\(C10 \\+ C01\\), is 0 Pa"),
        ("mooney_rivlin", {"c10": -1e5, "c01": 5e4}, "must be positive"),
        ("yeoh", {"c10": 0}, "2 C10, is 0 Pa"),
        ("ogden", {"mu": [1e5, -2e5], "alpha": [2, -2]}, "the sum of mu, is -100000 Pa"),
        ("ogden", {"mu": [1e5], "alpha": [2, -2]}, "mu has 1 and alpha 2 numbers"),
        ("ogden", {"mu": [1e5], "alpha": [0]}, "an alpha is 0"),
        ("ogden", {"mu": [], "alpha": []}, "at least 1"),
        ("yeoh", {"c10": "3 mm"}, "pressure or modulus"),
    ],
)
def test_constants_without_sense_are_refused(kind: str, keys: dict[str, object], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        law(kind, **keys)


def test_where_a_law_is_unstable_is_said() -> None:
    """Yeoh with C20 = −C10/5: the uniaxial stress 2 (λ − λ⁻²)(C10 + 2 C20 (I₁ − 3)) peaks near λ = 1.57."""
    weak = law("yeoh", c10=1e5, c20=-2e4, poisson_ratio=0.4995)
    stretch = np.linspace(1, 2, 100001)
    form = 2 * (stretch - stretch**-2) * (1e5 - 4e4 * (stretch**2 + 2 / stretch - 3))
    below, above = falling_stretches(weak)
    assert above == pytest.approx(stretch[np.argmax(form)], abs=0.02)
    (remark,) = weak.remarks()
    assert f"above {above:.2f} (uniaxial)" in remark
    assert below is None or below < 0.55
    assert law("mooney_rivlin", c10=90e3, c01=30e3).remarks() == ()
