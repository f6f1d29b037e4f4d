"""Laws of every kind to test, inside and far outside their boxes, and their plain functions."""

from __future__ import annotations

from typing import Any

import numpy as np

from pliant.records.design import Design
from pliant.records.fem import FemDataset
from pliant.records.law import Domain, Effort, JointLaw
from pliant_plugins.surrogates.config import PolynomialConfig, StudyCoefficients
from pliant_plugins.surrogates.neural.law import NeuralLaw
from pliant_plugins.surrogates.neural.network import Network
from pliant_plugins.surrogates.polynomial.axes import AxesLaw
from pliant_plugins.surrogates.polynomial.energy import EnergyBasis
from pliant_plugins.surrogates.polynomial.energy_law import EnergyPolynomialLaw
from pliant_plugins.surrogates.polynomial.law import PolynomialLaw, study_law
from pliant_plugins.surrogates.polynomial.surrogate import Polynomial

PRESSURE_PA = 15e3
AXES = {1: ("y",), 2: ("y", "z"), 3: ("x", "y", "z")}
BOX = Domain(np.array([0.0, PRESSURE_PA]), np.array([[-0.2, 0.45]]))
# A stable law of degree 4 whose stiffness changes with pressure in both directions.
TABLE = 1e-3 * np.array(
    [
        [12.0, -20.0, 1.0, -2.0, -0.5],
        [11.0, 2.5, -1.5, 0.8, 0.0],
        [1.0, -1.2, 0.7, 0.0, 0.0],
        [0.2, 0.5, 0.0, 0.0, 0.0],
    ]
)
WAVY = PolynomialLaw(TABLE, np.array([7.5e3, 7.5e3]), np.array([0.125, 0.325]), BOX, odd=-0.02)
WORKED = StudyCoefficients(k_n=1.637e-6, m_a=-1.704e-6, b_a=0.0, m_e=0.1012, b_e=0.0245)
STATED = {
    "stated": study_law(WORKED, True, BOX),
    "unbounded": study_law(WORKED, True, Domain.unbounded(1)),
    "plain square": study_law(WORKED, False, BOX),
    "bounded pressure": study_law(WORKED, True, Domain(BOX.actuation, Domain.unbounded(1).deformation)),
}
TWIST = {"k_n": 0.0, "m_a": -2e-7, "m_e": 0.01, "b_e": 0.03}
SIDE = {"k_n": 0.0, "m_a": -1e-7, "m_e": 0.02, "b_e": 0.015}
MAIN = {"k_n": 1.6e-6, "m_a": -1.7e-6, "m_e": 0.1, "b_e": 0.0245}

ENERGY_BOX = np.array([[0.0, 15e3], [-0.3, 0.3], [-0.2, 0.5], [-0.35, 0.35]])
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


def energy_law(axes: int) -> EnergyPolynomialLaw:
    """Return the sample's energy law of the axes y, or x and y, or all."""
    keep = {1: [2], 2: [1, 2], 3: [1, 2, 3]}[axes]
    chosen = {t: c for t, c in TERMS.items() if all(t[i] == 0 for i in range(1, 4) if i not in keep)}
    exponents = np.array([[t[0], *(t[i] for i in keep)] for t in chosen])
    maps = np.column_stack([ENERGY_BOX.mean(axis=1), np.ptp(ENERGY_BOX, axis=1) / 2])
    return EnergyPolynomialLaw(
        EnergyBasis(exponents, maps[0], maps[keep]),
        1e-3 * np.array(list(chosen.values())),
        Domain(ENERGY_BOX[0], ENERGY_BOX[keep]),
        axes=tuple("xyz"[i - 1] for i in keep),
        joint="spherical" if axes == 3 else "revolute",
    )


def network_law(k: int, units: int = 12, seed: int = 1, m: int = 1) -> NeuralLaw:
    """Return a stable law of k axes and m inputs: units of random directions plus a dominant quadratic form."""
    random = np.random.default_rng(seed)
    weights = random.normal(size=(units, m + k)) * np.array([*[1 / 7500] * m, *[2.0] * k])
    stiffness = 0.03 * np.eye(k) + 0.005
    factors = 0.01 / units * random.normal(size=units)
    network = Network(
        weights,
        random.uniform(-1, 1, units),
        factors,
        1e-4 * np.ones(k),
        1e-6 * (np.arange(1, k + 1) if m == 1 else random.normal(size=(k, m))),
        stiffness,
    )
    pressures = np.array([0.0, PRESSURE_PA]) if m == 1 else np.tile([0.0, PRESSURE_PA], (m, 1))
    domain = Domain(pressures, np.tile([-0.2, 0.4], (k, 1)))
    name = "pressure_pa" if m == 1 else ", ".join(f"pressure_{j}_pa" for j in range(1, m + 1))
    return NeuralLaw(network, domain, AXES[k], "revolute" if k == 1 else "spherical", name)


def states(
    p: Any,
    u: Any,
    moment: Any,
    by_p: Any = None,
    by_u: Any = None,
    *,
    check: Any = None,
    axis: str = "y",
    **more: Any,
) -> FemDataset:
    """Return constrained states of one axis; slopes and energies not given are unknown; `check` marks scored ones."""
    p, u, moment = (np.asarray(values, float) for values in (p, u, moment))
    n = len(p)
    nan = np.full(n, np.nan)
    role = np.full(n, "fit") if check is None else np.where(check, "check", "fit")
    slopes = (nan if by_p is None else by_p, nan if by_u is None else by_u, more.pop("energy_j", nan))
    text = (np.full(n, "constrained"), np.full(n, "ok"), role)
    return FemDataset(Design("test", {}), axis, "pressure_pa", p, u, moment, *slopes, *text, **more)


def stated(coefficients: dict[str, float], **more: Any) -> dict[str, Any]:
    return {"form": "study", "odd": True, "coefficients": coefficients, **more}


def surrogate(**config: Any) -> Polynomial:
    return Polynomial(PolynomialConfig.model_validate(config))


def spatial(**y: Any) -> AxesLaw:
    axes = {"x": stated(TWIST), "y": y or stated(MAIN), "z": stated(SIDE)}
    law = surrogate(axes=axes).stated()
    assert isinstance(law, AxesLaw)
    return law


def with_a_box() -> AxesLaw:
    """Return axes whose boxes, degrees and continuations differ."""
    x, _, z = spatial().laws
    return AxesLaw((x, WAVY, z))


def points(law: JointLaw, beyond: float, n: int = 200, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Return scattered p (n,), (n, m) of several, and u (n, k), up to `beyond` box widths outside.

    Limits that a law lacks are those of `BOX`.
    """
    box, m = np.vstack([law.domain.actuation, law.domain.deformation]), len(law.actuations)
    usual = np.vstack([*[BOX.actuation] * m, np.repeat(BOX.deformation, len(law.axes), axis=0)])
    box = np.where(np.isfinite(box), box, usual)
    share = np.random.default_rng(seed).uniform(-beyond, 1 + beyond, (n, len(box)))
    at = box[:, 0] + share * np.ptp(box, axis=1)
    return split(law, at)


def split(law: JointLaw, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return p (n,), or (n, m) of several, and u (n, k) of points (n, m + k)."""
    m = len(law.actuations)
    return at[:, 0 if m == 1 else slice(m)], at[:, m:]


def one_by_one(law: JointLaw, p: np.ndarray, u: np.ndarray) -> Effort:
    """Call `evaluate` through the plain function; the arrays to fill start with arbitrary values."""
    scalar = law.scalar()
    assert scalar is not None
    n, a = u.shape
    tau, gain, slope = np.full((n, a), 7.0), np.full((n, p[0].size * a), 7.0), np.full((n, a, a), 7.0)
    for i in range(n):
        at = float(p[i]) if p.ndim == 1 else p[i]
        scalar.function(at, u[i], scalar.parameters, tau[i], gain[i], slope[i])
    return Effort(tau, gain if p.ndim == 1 else gain.reshape(n, a, -1), slope)


def require_same(found: Effort, wanted: Effort, rtol: float = 1e-12) -> None:
    for name in ("tau", "dtau_dp", "dtau_du"):
        values = getattr(wanted, name)
        atol = rtol * np.abs(values).max(initial=0.0)
        np.testing.assert_allclose(getattr(found, name), values, rtol=rtol, atol=atol, err_msg=name)
