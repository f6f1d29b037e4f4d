"""Joint laws, chains and tables with known answers, for checks and for the tests of plugins."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pliant.config.chain import ChainConfig
from pliant.pipeline.chain import Segment, build_chain, rod_module
from pliant.records.chain import ChainModel
from pliant.records.design import Array, Design
from pliant.records.fem import FemDataset
from pliant.records.law import Domain, Effort, JointKind, JointLaw, LawRecord

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


def linear_law(gain: float = 8e-7, stiffness: float = 0.04, domain: Domain | None = None) -> LinearLaw:
    """A hinge that bends by g p / k under the pressure p."""
    box = domain or Domain.unbounded(1)
    return LinearLaw(np.array([gain]), np.array([[stiffness]]), box)


def linear_spherical_law() -> LinearLaw:
    """Three coupled axes x, y, z; pressure turns mostly about y."""
    stiffness = np.array([[0.05, 0.004, 0.0], [0.004, 0.04, -0.003], [0.0, -0.003, 0.06]])
    gain = np.array([2e-7, 8e-7, -3e-7])
    return LinearLaw(gain, stiffness, Domain.unbounded(3), "spherical", ("x", "y", "z"))


def linear_prismatic_law() -> LinearLaw:
    """A joint that extends along x."""
    return LinearLaw(np.array([2e-5]), np.array([[400.0]]), Domain.unbounded(1), "prismatic", ("x",))


def softening_law() -> SofteningLaw:
    """The worked law, without limits."""
    return SofteningLaw(Domain.unbounded(1))


def sample_chain(
    law: JointLaw | None = None, modules: int = 8, turns_rad: Sequence[float] = (0.0,), **chain: object
) -> ChainModel:
    """A chain of equal thin modules; `turns_rad` gives the rotation of each segment of `modules` modules.

    Further keys are those of a study's `chain` block, such as ``gravity=(0, 0, 0)`` or ``payload=0.01``.
    """
    module = rod_module(law or softening_law(), MODULE_LENGTH_M, MODULE_MASS_KG)
    config = ChainConfig.model_validate({"modules": modules, **chain})
    return build_chain(config, [Segment(module, modules, turn) for turn in turns_rad])


def table_of(law: JointLaw, noise_n_m: float = 0.0, pressures: int = 6, angles: int = 7) -> FemDataset:
    """FEM-like states of a one-axis law: a grid of role "fit" and ten scattered states of role "check"."""
    p, u = np.meshgrid(np.linspace(0, PRESSURE_PA, pressures), np.linspace(-0.2, 0.45, angles), indexing="ij")
    random = np.random.default_rng(7)
    p = np.concatenate([p.ravel(), PRESSURE_PA * random.random(10)])
    u = np.concatenate([u.ravel(), -0.2 + 0.65 * random.random(10)])
    effort = law.evaluate(p, u[:, None])
    n = len(p)
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
