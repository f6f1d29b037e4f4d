"""Families of laws that are smooth in two parameters, and their data in the form of FEM data, for meta-models.

Every law derives from an energy with the symmetry of a module whose mirror plane is y = 0, and is stable in its
box: −0.5 to 1.2 times the largest free angle about y, ±0.3 rad about x and z.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import product

import numpy as np

from pliant.records.actuation import Levels
from pliant.records.design import Array, Design
from pliant.records.fem import ModuleData
from pliant.records.law import Domain, JointLaw
from pliant.testing.samples import EnergyLaw, OpposedLaw, energy_law
from pliant_designs.records import SolvedDesigns

FAMILY = "sample"
NAMES = ("average_radius_m", "wall_m")
RANGE = np.array([[6e-3, 9e-3], [1.2e-3, 1.8e-3]])
FIXED = {"module_length_m": 10e-3}
PRESSURE_PA = 15e3
LATERAL_RAD = 0.3


def sample_law(values: Array) -> EnergyLaw:
    """Return the true law of one axis, y, of a design (R, t), with its box:

    τ = k p + m p u − b u − c u² − d u³ with k ∝ R³, m ∝ R², b ∝ t², c ∝ t, d ∝ t/R.
    """
    law = energy_law(_bending_terms(values))
    return replace(law, domain=Domain(np.array([0.0, PRESSURE_PA]), _bending_range(law)[None]))


def _bending_terms(values: Array) -> dict[tuple[int, ...], float]:
    r, t = float(values[0] / 7.5e-3), float(values[1] / 1.5e-3)
    k, m, b, c, d = 1.6e-6 * r**3, -0.8e-6 * r**2, 0.03 * t**2, 0.02 * t, 0.02 * t / r
    return {(1, 1): -k, (1, 2): -m / 2, (0, 2): b / 2, (0, 3): c / 3, (0, 4): d / 4}


def spherical_sample_law(values: Array) -> EnergyLaw:
    """Return the true law of three axes, with its box: the same about y; x and z are coupled with it and each other by

    −∂/∂u of ½ b_x u_x² + ½ b_z u_z² + g u_x u_z + (e u_y + h p)(u_x² + u_z²)/2.
    """
    r, t = float(values[0] / 7.5e-3), float(values[1] / 1.5e-3)
    b_x, b_z, g, e, h = 0.03 * t, 0.02 * t * r, 0.002 * t, 0.01 * r, 2e-7 * r**2
    alone = _bending_terms(values)
    terms: dict[tuple[int, ...], float] = {(a, 0, b, 0): value for (a, b), value in alone.items()}
    terms |= {(0, 2, 0, 0): b_x / 2, (0, 0, 0, 2): b_z / 2, (0, 1, 0, 1): g}
    for x, z in ((2, 0), (0, 2)):
        terms |= {(0, x, 1, z): e / 2, (1, x, 0, z): h / 2}
    lateral = np.array([-LATERAL_RAD, LATERAL_RAD])
    bending = _bending_range(energy_law(alone))
    box = np.stack([lateral, bending, lateral])
    return energy_law(terms, Domain(np.array([0.0, PRESSURE_PA]), box))


def opposed_sample_law(values: Array) -> OpposedLaw:
    """Return the true law of one axis under two pressures, with its box: ± 1.2 times the angle of one of them.

    τ = g (p₁ − p₂) − (K + c (p₁ + p₂)) u − q u³ with g ∝ R³, K ∝ t², c ∝ R t, q ∝ t/R.
    """
    r, t = float(values[0] / 7.5e-3), float(values[1] / 1.5e-3)
    inputs = np.tile([0.0, PRESSURE_PA], (2, 1))
    law = OpposedLaw(Domain(inputs, np.zeros((1, 2))), 1.6e-6 * r**3, 0.03 * t**2, 4e-7 * r * t, 0.02 * t / r)
    most = 1.2 * free_angles(law, np.array([[PRESSURE_PA, 0.0]]))[0, 0]
    return replace(law, domain=Domain(inputs, np.array([[-most, most]])))


def _bending_range(law: JointLaw) -> Array:
    wide: Array = np.array([-0.5, 1.2]) * free_angles(law, np.array([PRESSURE_PA]))[0, 0]
    return wide


def held(law: JointLaw, actuation: Array, deformation: Array) -> Array:
    """Return (n, a) deformation with zero effort about the axes that are NaN in `deformation`, by Newton."""
    p, free = np.asarray(actuation, float), np.isnan(deformation)
    u = np.where(free, 0.0, deformation)
    identity = np.eye(u.shape[1])
    for _ in range(12 if free.any() else 0):
        effort = law.evaluate(p, u)
        slopes = np.where(free[:, :, None] & free[:, None, :], effort.dtau_du, identity)
        u = u - np.linalg.solve(slopes, np.where(free, effort.tau, 0.0)[:, :, None])[:, :, 0]
    return u


def free_angles(law: JointLaw, actuation: Array) -> Array:
    """Return (n, a) deformation of the free joint."""
    p = np.asarray(actuation, float)
    return held(law, p, np.full((len(p), len(law.axes)), np.nan))


def grid(counts: tuple[int, int], within: Array = RANGE) -> Array:
    """Return (n, 2) designs on a regular grid over the range."""
    ticks = [np.linspace(low, high, count) for (low, high), count in zip(within, counts, strict=True)]
    points: Array = np.stack(np.meshgrid(*ticks, indexing="ij"), axis=-1).reshape(-1, 2)
    return points


def unseen_designs(count: int = 6, seed: int = 5) -> Array:
    """Return (count, 2) designs between those of a grid, in the middle 80 % of the range."""
    middle, width = RANGE.mean(axis=1), np.ptp(RANGE, axis=1)
    shares = np.random.default_rng(seed).uniform(-0.4, 0.4, (count, 2))
    points: Array = middle + shares * width
    return points


def solved_designs(counts: tuple[int, int] = (4, 4)) -> SolvedDesigns:
    """Return designs with one axis: about 20 states of role "fit" and 5 of role "check" each."""
    return _solved(grid(counts), sample_law, _one_axis_states)


def solved_opposed_designs(counts: tuple[int, int] = (4, 4)) -> SolvedDesigns:
    """Return designs with one axis under two pressures: 31 states of role "fit" and 8 of role "check" each."""
    return _solved(grid(counts), opposed_sample_law, _two_input_states)


def solved_spherical_designs(counts: tuple[int, int] = (4, 4)) -> SolvedDesigns:
    """Return designs with three axes: about 50 states of role "fit" and 10 of role "check" each."""
    return _solved(grid(counts), spherical_sample_law, _three_axis_states)


# Prescribed values of a state, explored axis, branch and role; pressures and angles as shares of their ranges.
_Plan = tuple[Levels, dict[str, float], str, str, str]


def _one_axis_states() -> list[_Plan]:
    random = np.random.default_rng(7)
    free: list[_Plan] = [(s, {}, "y", "free", "fit") for s in np.linspace(0, 1, 5)]
    shares = [(s, v) for s in (0.0, 0.5, 1.0) for v in np.linspace(0, 1, 5)]
    fitted: list[_Plan] = [(s, {"y": v}, "y", "constrained", "fit") for s, v in shares]
    check: list[_Plan] = [
        (float(s), {"y": float(v)}, "y", "constrained", "check") for s, v in random.random((5, 2))
    ]
    return [*free, *fitted, *check]


def _two_input_states() -> list[_Plan]:
    random = np.random.default_rng(9)
    free: list[_Plan] = [
        (s, {}, "y", "free", "fit") for s in ((0, 0), (0.5, 0), (1, 0), (0, 0.5), (0, 1), (1, 1))
    ]
    corners = product((0.0, 1.0), repeat=3)
    inside = random.random((25, 3))
    held: list[_Plan] = [
        ((a, b), {"y": float(v)}, "y", "constrained", "check" if number < 8 else "fit")
        for number, (a, b, v) in enumerate([*inside[:8], *corners, *inside[8:]])
    ]
    return [*free, *held]


def _three_axis_states() -> list[_Plan]:
    random = np.random.default_rng(8)
    grid = product("xz", (0.0, 0.5, 1.0), (0.0, 0.25, 1.0))
    lateral: list[_Plan] = [(s, {axis: v}, axis, "constrained", "fit") for axis, s, v in grid]
    whole: list[_Plan] = [
        (float(s), dict(zip("xyz", map(float, v), strict=True)), "coupling", "constrained", role)
        for role, count in (("fit", 14), ("check", 6))
        for s, *v in random.random((count, 4))
    ]
    return [*_one_axis_states(), *lateral, *whole]


def _solved(
    values: Array, law_of: Callable[[Array], JointLaw], plan: Callable[[], list[_Plan]]
) -> SolvedDesigns:
    data = tuple(_data(row, law_of(row), plan()) for row in values)
    return SolvedDesigns(FAMILY, NAMES, values, FIXED, data)


def _data(values: Array, law: JointLaw, plan: list[_Plan]) -> ModuleData:
    pressed, angles, explored, branch, role = zip(*plan, strict=True)
    p = np.array(pressed) * PRESSURE_PA
    low, high = law.domain.deformation.T
    shares = np.array([[of.get(axis, np.nan) for axis in law.axes] for of in angles])
    u = held(law, p, low + shares * (high - low))
    effort = law.evaluate(p, u)
    n = len(p)
    energy = law.potential(law.unactuated(n), u)
    return ModuleData(
        design=Design(FAMILY, {**FIXED, **dict(zip(NAMES, map(float, values), strict=True))}),
        joint=law.joint,
        axes=law.axes,
        main_axis="y",
        actuation_name=law.actuation_name,
        actuation=p,
        deformation=u,
        tau=effort.tau,
        dtau_dp=effort.dtau_dp,
        dtau_du=effort.dtau_du,
        energy_j=energy,
        travel=np.full_like(p, np.nan),
        iterations=np.full(n, 4),
        wall_s=np.full(n, 0.3),
        explored=np.array(explored),
        branch=np.array(branch),
        status=np.full(n, "ok"),
        role=np.array(role),
    )
