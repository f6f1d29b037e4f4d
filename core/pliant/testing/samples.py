"""Joint laws, chains, tables and scenes with known answers, for checks and for the tests of plugins."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from pliant.config.chain import ChainConfig
from pliant.mechanics.rotations import exp_map
from pliant.pipeline.chain import Segment, build_chain, rod_module
from pliant.records.chain import ChainModel
from pliant.records.design import Array, Design, MassProperties
from pliant.records.error_bar import ErrorBar
from pliant.records.fem import FemDataset, IntArray, ModuleData
from pliant.records.law import EXTENSIBLE_AXES, Domain, Effort, JointKind, JointLaw, LawRecord
from pliant.records.rollout import Inputs
from pliant.records.scene import Arm, FreeBody, Scene
from pliant.records.shape import Shape

# The coefficients of an energy by powers of p and of each u.
Terms = Mapping[tuple[int, ...], float]
MODULE_LENGTH_M = 11e-3
MODULE_MASS_KG = 1.6e-3
PRESSURE_PA = 15e3


@dataclass(frozen=True, eq=False)
class LinearLaw(JointLaw):
    """τ(p, u) = g p − K u, with g (a,) and a symmetric positive K (a, a)."""

    gain: Array
    stiffness: Array
    domain: Domain
    joint: JointKind = "revolute"
    axes: tuple[str, ...] = ("y",)
    actuation_name: str = "pressure_pa"
    error: ErrorBar | None = None

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        p, u = np.asarray(actuation, float), np.asarray(deformation, float)
        n = len(u)
        return Effort(
            p[:, None] * self.gain - u @ self.stiffness.T,
            np.tile(self.gain, (n, 1)),
            np.tile(-self.stiffness, (n, 1, 1)),
        )

    def record(self) -> LawRecord:
        values = {"joint": self.joint, "axes": list(self.axes)}
        return LawRecord("linear_sample", values, {"gain": self.gain, "stiffness": self.stiffness})


@dataclass(frozen=True, eq=False)
class SofteningLaw(JointLaw):
    """The worked law of docs/conventions.md, odd in u: τ = k_n p + m_a p u − (m_e u|u|/2 + b_e u)."""

    domain: Domain
    k_n: float = 1.637e-6
    m_a: float = -1.704e-6
    m_e: float = 0.1012
    b_e: float = 0.0245
    joint: JointKind = "revolute"
    axes: tuple[str, ...] = ("y",)
    actuation_name: str = "pressure_pa"

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        p, u = np.asarray(actuation, float), np.asarray(deformation, float)[:, 0]
        tau = self.k_n * p + self.m_a * p * u - (self.m_e * u * np.abs(u) / 2 + self.b_e * u)
        slope = self.m_a * p - self.m_e * np.abs(u) - self.b_e
        return Effort(tau[:, None], (self.k_n + self.m_a * u)[:, None], slope[:, None, None])

    def record(self) -> LawRecord:
        values = {"k_n": self.k_n, "m_a": self.m_a, "m_e": self.m_e, "b_e": self.b_e}
        return LawRecord("softening_sample", values, {})


@dataclass(frozen=True, eq=False)
class OpposedLaw(JointLaw):
    """Law of two opposed chambers that also stiffen: τ = g (p₁ − p₂) − (K + c (p₁ + p₂)) u − q u³."""

    domain: Domain
    gain: float = 1.6e-6
    stiffness: float = 0.03
    stiffening: float = 4e-7
    cubic: float = 0.02
    joint: JointKind = "revolute"
    axes: tuple[str, ...] = ("y",)
    actuation_name: str = "pressure_1_pa, pressure_2_pa"

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        p, u = np.asarray(actuation, float), np.asarray(deformation, float)
        held = (self.stiffness + self.stiffening * p.sum(axis=1))[:, None]
        tau = self.gain * (p[:, :1] - p[:, 1:]) - held * u - self.cubic * u**3
        by_p = np.stack([self.gain - self.stiffening * u, -self.gain - self.stiffening * u], axis=2)
        return Effort(tau, by_p, (-held - 3 * self.cubic * u**2)[:, :, None])

    def record(self) -> LawRecord:
        names = ("gain", "stiffness", "stiffening", "cubic")
        return LawRecord("opposed_sample", {name: getattr(self, name) for name in names}, {})


def opposed_law() -> OpposedLaw:
    """Return the law of two chambers, without limits."""
    return OpposedLaw(Domain(np.tile([-np.inf, np.inf], (2, 1)), np.array([[-np.inf, np.inf]])))


def opposed_table(count: int = 80) -> ModuleData:
    """Return scattered states of `opposed_law`, including corners of the box, every fifth of role "check"."""
    random, law = np.random.default_rng(5), opposed_law()
    corners = np.array(list(product((0.0, 1.0), repeat=3)))
    at = np.vstack([corners, random.random((count - len(corners), 3))])
    p, u = PRESSURE_PA * at[:, :2], -0.4 + 0.8 * at[:, 2:]
    n = len(at)
    role = np.where((np.arange(n) % 5 == 4) & (np.arange(n) >= len(corners)), "check", "fit")
    return _table(law, p, u, role, travel=np.full((n, 2), np.nan))


def _table(law: JointLaw, p: Array, u: Array, role: Any, **own: Any) -> ModuleData:
    """Return the states of a law with every deformation prescribed, without energies; `own` overrides fields."""
    effort, n = law.evaluate(p, u), len(p)
    fields = {
        "tau": effort.tau,
        "dtau_dp": effort.dtau_dp,
        "dtau_du": effort.dtau_du,
        "energy_j": np.full(n, np.nan),
        "travel": np.full(n, np.nan),
        "explored": np.full(n, "y"),
    }
    return ModuleData(
        design=Design("sample", {}),
        joint=law.joint,
        axes=law.axes,
        main_axis="y",
        actuation_name=law.actuation_name,
        actuation=p,
        deformation=u,
        iterations=np.zeros(n, np.int64),
        wall_s=np.zeros(n),
        branch=np.full(n, "constrained"),
        status=np.full(n, "ok"),
        role=role,
        **{**fields, **own},
    )


def linear_law(gain: float = 8e-7, stiffness: float = 0.04, domain: Domain | None = None) -> LinearLaw:
    """Return a hinge that bends by g p / k under the pressure p."""
    box = domain or Domain.unbounded(1)
    return LinearLaw(np.array([gain]), np.array([[stiffness]]), box)


def linear_spherical_law() -> LinearLaw:
    """Return a law of three coupled axes x, y, z; pressure bends mostly about y."""
    stiffness = np.array([[0.05, 0.004, 0.0], [0.004, 0.04, -0.003], [0.0, -0.003, 0.06]])
    gain = np.array([2e-7, 8e-7, -3e-7])
    return LinearLaw(gain, stiffness, Domain.unbounded(3), "spherical", ("x", "y", "z"))


def linear_prismatic_law() -> LinearLaw:
    """Return a joint that extends along x."""
    return LinearLaw(np.array([2e-5]), np.array([[400.0]]), Domain.unbounded(1), "prismatic", ("x",))


def linear_extensible_law() -> LinearLaw:
    """Return a law of the three axes of `linear_spherical_law` and an extension, which bending about y shortens."""
    turns = linear_spherical_law()
    stiffness = np.zeros((4, 4))
    stiffness[:3, :3] = turns.stiffness
    stiffness[3] = stiffness[:, 3] = [0.0, 0.3, 0.0, 400.0]
    return LinearLaw(
        np.append(turns.gain, 2e-5), stiffness, Domain.unbounded(4), "extensible", EXTENSIBLE_AXES
    )


def barred_law(law: LinearLaw, domain: Domain, size: float, seed: int = 0) -> LinearLaw:
    """Return the law with this domain and the error bar of normal residuals of one size (N·m, N) everywhere."""
    random = np.random.default_rng(seed)
    k = len(law.axes)
    box = np.vstack([domain.actuation, domain.deformation])
    places = box[:, 0] + np.ptp(box, axis=1) * random.random((300, 1 + k))
    bar = ErrorBar.from_residuals(box, places[:, 0], places[:, 1:], size * random.standard_normal((300, k)))
    return replace(law, domain=domain, error=bar)


def softening_law() -> SofteningLaw:
    """Return the worked law, without limits."""
    return SofteningLaw(Domain.unbounded(1))


def sample_chain(
    law: JointLaw | None = None, modules: int = 8, turns_rad: Sequence[float] = (0.0,), **chain: object
) -> ChainModel:
    """Return a chain of equal thin modules; `turns_rad` gives the rotation of each segment of `modules` modules.

    Further keys are those of a study's `chain` block, such as ``gravity=(0, 0, 0)`` or ``payload=0.01``.
    """
    module = rod_module(law or softening_law(), MODULE_LENGTH_M, MODULE_MASS_KG)
    config = ChainConfig.model_validate({"modules": modules, **chain})
    return build_chain(config, [Segment(module, modules, turn) for turn in turns_rad])


def sample_table(law: JointLaw, noise_n_m: float = 0.0, pressures: int = 6, angles: int = 7) -> FemDataset:
    """Return FEM-like states of a one-axis law: a grid of role "fit" and ten scattered states of role "check"."""
    grid = np.meshgrid(np.linspace(0, PRESSURE_PA, pressures), np.linspace(-0.2, 0.45, angles), indexing="ij")
    random = np.random.default_rng(7)
    p = np.concatenate([grid[0].ravel(), PRESSURE_PA * random.random(10)])
    u = np.concatenate([grid[1].ravel(), -0.2 + 0.65 * random.random(10)])
    effort, n = law.evaluate(p, u[:, None]), len(p)
    return FemDataset(
        design=Design("sample", {}),
        axis=law.axes[0],
        actuation_name=law.actuation_name,
        actuation=p,
        angle_rad=u,
        moment_n_m=effort.tau[:, 0] + noise_n_m * random.standard_normal(n),
        dmoment_dp=effort.dtau_dp[:, 0],
        dmoment_du=effort.dtau_du[:, 0, 0],
        energy_j=np.full(n, np.nan),
        branch=np.full(n, "constrained"),
        status=np.full(n, "ok"),
        role=np.where(np.arange(n) < n - 10, "fit", "check"),
    )


@dataclass(frozen=True, eq=False)
class EnergyLaw(JointLaw):
    """τ = −∂Π/∂u of Π = Σ_j c_j p^a_j u^b_j, with a_j 0 or 1 and u^b the product over all axes.

    Attributes:
        terms: c (j,).
        powers: (j, 1 + axes), a and b of each term.
    """

    terms: Array
    powers: IntArray
    domain: Domain
    joint: JointKind = "revolute"
    axes: tuple[str, ...] = ("y",)
    actuation_name: str = "pressure_pa"

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        p, u = np.asarray(actuation, float), np.asarray(deformation, float)
        n, a = u.shape
        driven = np.where(self.powers[:, 0] > 0, self.terms, 0.0)
        tau = [slope_columns(self.powers, p, u, (k,)) @ self.terms for k in range(a)]
        by_p = [slope_columns(self.powers, np.ones(n), u, (k,)) @ driven for k in range(a)]
        by_u = [slope_columns(self.powers, p, u, pair) @ self.terms for pair in product(range(a), repeat=2)]
        return Effort(
            -np.stack(tau, axis=1), -np.stack(by_p, axis=1), -np.stack(by_u, axis=1).reshape(n, a, a)
        )

    def potential(self, actuation: Array, deformation: Array) -> Array:
        p, u = np.asarray(actuation, float), np.asarray(deformation, float)
        energy: Array = slope_columns(self.powers, p, u, ()) @ self.terms
        return energy

    def record(self) -> LawRecord:
        values = {"joint": self.joint, "axes": list(self.axes), "actuation_name": self.actuation_name}
        box = {"actuation": self.domain.actuation, "deformation": self.domain.deformation}
        return LawRecord(
            "energy_sample", values, {"terms": self.terms, "powers": self.powers.astype(float), **box}
        )


def slope_columns(powers: IntArray, p: Array, u: Array, axes: tuple[int, ...]) -> Array:
    """Return (n, j) each term p^a u^b of an energy, differentiated by the u of the axes named."""
    left, factor = powers[:, 1:].copy(), np.ones(len(powers))
    for k in axes:
        factor = factor * left[:, k]
        left[:, k] = np.maximum(left[:, k] - 1, 0)
    columns: Array = factor * p[:, None] ** powers[:, 0] * np.prod(u[:, None, :] ** left, axis=2)
    return columns


def energy_law(terms: Terms, domain: Domain | None = None) -> EnergyLaw:
    """Return the law of an energy with coefficients by powers (of p, then of u): a hinge, or a ball joint."""
    powers = np.array(list(terms))
    coefficients, box = np.array(list(terms.values())), domain or Domain.unbounded(powers.shape[1] - 1)
    if powers.shape[1] == 2:
        return EnergyLaw(coefficients, powers, box)
    return EnergyLaw(coefficients, powers, box, "spherical", ("x", "y", "z"))


def sample_module_table(law: JointLaw, energies: bool = True, slopes: bool = True) -> ModuleData:
    """Return scattered states of a law of three axes: of each axis, of all prescribed, every fifth of role "check".

    With `energies` the work along the path: energy_j = Π + p·travel with travel = −∂Π/∂p, which a law of efforts
    determines up to a function of p, here zero.
    """
    random = np.random.default_rng(11)
    n = 100
    explored = np.array(["y", "x", "z", "coupling"])[np.arange(n) % 4]
    p = PRESSURE_PA * random.random(n)
    u = random.uniform([-0.3, -0.2, -0.3], [0.3, 0.45, 0.3], (n, 3))
    for k, axis in enumerate(law.axes):
        u[(explored != axis) & (explored != "coupling"), k] = 0.0
    signs = np.array([(i, j, k, m) for i in (0, 1) for j in (0, 1) for k in (0, 1) for m in (0, 1)])
    p[:16], explored[:16] = signs[:, 0] * PRESSURE_PA, "coupling"
    u[:16] = np.array([-0.3, -0.2, -0.3]) + signs[:, 1:] * np.array([0.6, 0.65, 0.6])
    role = np.where((np.arange(n) >= 16) & (np.arange(n) // 4 % 5 == 0), "check", "fit")
    own: dict[str, Any] = {"explored": explored}
    if energies:
        step = 1e-3 * PRESSURE_PA
        travel = (law.potential(p - step, u) - law.potential(p + step, u)) / (2 * step)
        own |= {"energy_j": law.potential(p, u) + p * travel, "travel": travel}
    if not slopes:
        own |= {"dtau_dp": np.full((n, 3), np.nan), "dtau_du": np.full((n, 3, 3), np.nan)}
    return _table(law, p, u, role, **own)


def coupled_law() -> EnergyLaw:
    """Return a law of three coupled axes, without limits: Π = K·u²/2 − p (g y + m y²/2) + a x² y − a y z²."""
    stiffness: Terms = {(0, 2, 0, 0): 0.025, (0, 0, 2, 0): 0.015, (0, 0, 0, 2): 0.02}
    driven: Terms = {(1, 0, 1, 0): -3e-7, (1, 0, 2, 0): -5e-8}
    return energy_law({**stiffness, **driven, (0, 2, 1, 0): 0.015, (0, 0, 1, 2): -0.015})


def chain_numbers(chain: ChainModel) -> Array:
    """Return all arrays of a chain, concatenated."""
    parts = [chain.tip_offset_m, chain.base_position_m, chain.base_rotation, chain.gravity_m_s2]
    parts += [a for j in chain.joints for a in (j.offset_m, j.rest_rotation)]
    parts += [a for b in chain.bodies for a in (b.com_m, b.inertia_kg_m2, np.array(b.mass_kg))]
    return np.concatenate([np.ravel(part) for part in parts])


# -- scenes

FINGER_RADIUS_M, FINGER_MODULE_KG = 6e-3, 4e-3
PINCH_PRESSURE_PA = 10e3
OBJECT_KG = 0.02
NO_GRAVITY_M_S2 = np.zeros(3)
HALF_TURN = exp_map(np.array([0.0, 0.0, np.pi]))


def sample_box(half_m: tuple[float, float, float] = (0.015, 0.015, 0.015), **changes: Any) -> FreeBody:
    """Return a uniform box of 20 g with friction 1 at the origin; `changes` are fields of `FreeBody`."""
    a, b, c = half_m
    inertia = OBJECT_KG / 3 * np.diag([b * b + c * c, a * a + c * c, a * a + b * b])
    fields: dict[str, Any] = {
        "name": "box",
        "mass": MassProperties(OBJECT_KG, np.zeros(3), inertia),
        "shapes": (Shape("box", half_m, np.zeros(3), np.eye(3)),),
        "friction": 1.0,
        "position_m": np.zeros(3),
        "rotation": np.eye(3),
    }
    return FreeBody(**{**fields, **changes})


def lopsided_box(**changes: Any) -> FreeBody:
    """Return a box whose centre of mass is not its origin, and whose principal axes are not its axes."""
    turn = exp_map(np.array([0.4, -0.3, 0.2]))
    inertia = turn @ np.diag([2e-6, 3e-6, 4e-6]) @ turn.T
    mass = MassProperties(OBJECT_KG, np.array([0.004, -0.002, 0.003]), inertia)
    return sample_box(mass=mass, **changes)


def sample_finger(
    base_m: tuple[float, float, float] = (0.0, 0.0, 0.0),
    law: JointLaw | None = None,
    modules: int = 3,
    facing: Array | None = None,
    **chain: object,
) -> ChainModel:
    """Return a round finger of 12 mm that hangs from `base_m` and bends toward world +x, rotated by `facing`."""
    module = rod_module(
        law or linear_law(gain=8e-6, stiffness=0.2), MODULE_LENGTH_M, FINGER_MODULE_KG, FINGER_RADIUS_M
    )
    built = build_chain(ChainConfig.model_validate({"modules": modules, **chain}), [Segment(module, modules)])
    turn = np.eye(3) if facing is None else facing
    return built.with_(base_position_m=np.array(base_m), base_rotation=turn @ built.base_rotation)


def pinch_scene() -> Scene:
    """Return two opposed fingers on both sides of a box on a floor; 10 kPa press them to it."""
    left = sample_finger((-0.026, 0.0, 0.05))
    right = sample_finger((0.026, 0.0, 0.05), facing=HALF_TURN)
    box = sample_box(half_m=(0.015, 0.015, 0.02), position_m=np.array([0.0, 0.0, 0.02]))
    return Scene((Arm(left), Arm(right)), (box,), floor_m=0.0)


def pinching(pressure_pa: float = PINCH_PRESSURE_PA) -> tuple[Inputs, Inputs]:
    """Return the inputs of both fingers of `pinch_scene`."""
    inputs = Inputs({"pressure_pa": pressure_pa})
    return inputs, inputs


def scene_numbers(scene: Scene) -> Array:
    """Return all arrays of a scene, concatenated."""
    parts = [scene.gravity_m_s2, *(chain_numbers(arm.chain) for arm in scene.arms)]
    shapes = [shape for arm in scene.arms for piece in arm.chain.shapes for shape in piece]
    parts += [a for body in scene.objects for a in (body.mass.com_m, body.mass.inertia_kg_m2)]
    shapes += [shape for body in scene.objects for shape in body.shapes]
    parts += [a for posed in shapes for a in (posed.position_m, posed.rotation)]
    parts += [a for body in scene.objects for a in (body.position_m, body.rotation)]
    return np.concatenate([np.ravel(part) for part in parts])


def dashpot(
    angle: float, rate: float, dt_s: float, actuation: float, temp_c: float, old: Array, new: Array, c: Array
) -> float:
    """Return M = −c u'."""
    return -c[0] * rate
