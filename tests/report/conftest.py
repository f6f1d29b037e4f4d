"""A finished run computed from formulas: a bent tube as the module, a stated law, engines that differ slightly."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pliant.config.chain import BaseConfig
from pliant.mechanics.rotations import exp_map
from pliant.pipeline.chain import base_rotation
from pliant.pipeline.run_folder import DesignResult, EngineResult, FinishedRun
from pliant.records.design import Design
from pliant.records.fem import FemDataset, ModuleShape
from pliant.records.law import Domain, Effort, FitReport, JointLaw, LawRecord
from pliant.records.rollout import Equilibrium, OutsideDomain, Rollout, TaskResult

LENGTH = 0.011
FULL = 15e3
K_N, M_A, B_E, M_E = 1.6e-6, -1.7e-6, 0.0245, 0.1
FREE = 0.36
DOMAIN = Domain(np.array([0.0, FULL]), np.array([[-0.2, 0.45]]))


@dataclass(frozen=True, eq=False)
class PlainLaw(JointLaw):
    """The published form about the main axis, linear springs about the others."""

    axes: tuple[str, ...] = ("y",)
    joint: Any = "revolute"
    actuation_name: str = "pressure_pa"
    domain: Domain = DOMAIN

    def evaluate(self, actuation: np.ndarray, deformation: np.ndarray) -> Effort:
        p, main = actuation, self.axes.index("y") if "y" in self.axes else 0
        tau = -0.03 * deformation
        u = deformation[:, main]
        tau[:, main] = K_N * p + M_A * p * u - M_E * u**2 / 2 - B_E * u
        n, a = deformation.shape
        return Effort(tau, np.zeros((n, a)), np.zeros((n, a, a)))

    def record(self) -> LawRecord:
        return LawRecord("plain", {"b_e": B_E}, {"k": np.array([K_N, M_A])})


def tube_shapes(count: int = 3) -> tuple[ModuleShape, ...]:
    """Return a quarter of a tube wall, bent on arcs: points of 9-node faces over (s, angle) on two radii."""
    s = np.linspace(0, LENGTH / 2, 5)
    angle = np.linspace(0, np.pi, 9)
    shapes = []
    for k in range(count):
        u = FREE * k / (count - 1)
        curvature = u / LENGTH
        grids = []
        for radius in (0.006, 0.004):
            S, A = np.meshgrid(s, angle, indexing="ij")
            y, z = radius * np.sin(A), 0.006 - radius * np.cos(A)
            turn = curvature * S
            x = S if u == 0 else (1 / curvature + z) * np.sin(turn)
            height = z if u == 0 else (1 / curvature + z) * np.cos(turn) - 1 / curvature
            grids.append(np.stack([x, y, height], axis=-1).reshape(-1, 3))
        ids = np.arange(45).reshape(5, 9)
        outer = [ids[i : i + 3, j : j + 3].T.ravel()[:9] for i in (0, 2) for j in (0, 2, 4, 6)]
        inner = [45 + ids[i : i + 3, j : j + 3].ravel() for i in (0, 2) for j in (0, 2, 4, 6)]
        faces = np.array([o.reshape(3, 3).ravel() for o in outer] + inner)
        shapes.append(ModuleShape(FULL * k / (count - 1), u, np.concatenate(grids), faces))
    return tuple(shapes)


def dataset(n_p: int = 5, n_u: int = 7, shapes: bool = True, family: str = "tube") -> FemDataset:
    """Return states on a grid, the last row for checking, two in self-contact, one failed."""
    p, u = (g.ravel() for g in np.meshgrid(np.linspace(0, FULL, n_p), np.linspace(-0.2, 0.45, n_u)))
    tau = PlainLaw().evaluate(p, u[:, None]).tau[:, 0] + 1e-5 * np.sin(40 * u)
    role = np.where(np.arange(len(p)) % 5 == 3, "check", "fit")
    status = np.full(len(p), "ok", dtype="<U12")
    status[:2] = "self_contact"
    nan = np.full(len(p), np.nan)
    failed = ({"branch": "constrained", "actuation": 9e3, "angle_rad": 0.4, "cause": "diverged <here>"},)
    return FemDataset(
        Design(family, {"radius_m": 0.006}), "y", "pressure_pa", p, u, tau, nan, nan, nan,
        np.full(len(p), "constrained"), status, role, failed, tube_shapes() if shapes else (),
    )  # fmt: skip


def fit_report() -> FitReport:
    form = {"rmse": 2e-4, "worst": 4e-4, "worst_of_range": 0.0123, "r2": 0.9989, "odd": False}
    form["parameters"] = {"k_n": K_N, "m_a": M_A, "b_a": 0.0, "m_e": M_E, "b_e": 1.02 * B_E}
    details = {"form": "adaptive", "degree": 4, "terms": 15, "stable": True, "study_form": form}
    return FitReport(28, 7, 1.5e-5, 3.5e-5, 0.00173, 0.999987, 0.0367, {**details, "held_out": "role check"})


def markers(angles: np.ndarray, axes: tuple[str, ...] = ("y",)) -> np.ndarray:
    """Return (n + 2, 3) markers of joint coordinates (n, a), default base."""
    basis = np.eye(3)[["xyz".index(a) for a in axes]]
    rotation, position = base_rotation(BaseConfig()), np.zeros(3)
    points, link = [position], LENGTH / 2
    for q in angles:
        position = position + link * rotation[:, 0]
        points.append(position)
        rotation, link = rotation @ exp_map(q @ basis), LENGTH
    return np.array([*points, position + LENGTH / 2 * rotation[:, 0]])


def engine(kind: str, angles: np.ndarray, axes: tuple[str, ...] = ("y",), **changes: Any) -> EngineResult:
    steps = np.linspace(0, 1, 6)
    history = Rollout(
        steps, FULL * steps[:, None], np.array([t * angles for t in steps]),
        np.array([markers(t * angles, axes) for t in steps]),
    )  # fmt: skip
    final = Equilibrium(angles, markers(angles, axes), 1e-9, True, True, 12, 0.02)
    metrics = {"tip_x_m": float(final.tip_m[0]), "bend_angle_rad": float(angles.sum()), "unsettled_levels": 0}
    return EngineResult(kind, TaskResult(replace(final, **changes), metrics, history))


def manifest(stage: str, wall_s: float, **config: Any) -> dict[str, Any]:
    return {
        "stage": stage, "key": "k" * 32, "created": "2026-01-02T03:04:05+00:00", "wall_s": wall_s, "code": "c0ffee" * 8,
        "libraries": {"scikit-fem": "12.0"}, "versions": {"numpy": "2.4"}, "python": "3.11.7", "platform": "Linux",
        "pliant": "0.1.0", "config": config, "inputs": {},
    }  # fmt: skip


def study(modules: int = 8, **changes: Any) -> dict[str, Any]:
    chain = {"modules": modules, "gravity_m_s2": [0.0, 0.0, 0.0]}
    task = {"kind": "free_bending", "pressure_pa": FULL}
    family = {"kind": "tube", "wall_m": 0.0015, "note": "<script>alert(1)</script>"}
    return {"pliant": 1, "name": "synthetic", "family": family, "chain": chain, "task": task, **changes}


def full_run(modules: int = 8) -> FinishedRun:
    """Return a run with FEM, fit, three engines, one of them skipped, and warnings of every sort."""
    angles = np.full((modules, 1), FREE)
    outside = (OutsideDomain(3, 1.0, "pressure_pa", 250.0), OutsideDomain(2, 1.0, "y", 0.02))
    engines = (
        engine("quasistatic", angles),
        engine("mujoco", angles + 1e-6, wall_s=0.06, outside_domain=outside),
    )
    manifests = (
        manifest("fem", 12.5),
        manifest("fit", 0.25),
        manifest("simulate", 0.03, physics={"kind": "mujoco"}),
    )
    design = DesignResult("synthetic", dataset(), PlainLaw(), fit_report())
    skipped = (("pybullet", "pybullet has no wheel for this Python"),)
    return FinishedRun({"unused": ["sweep"]}, study(modules), (design,), engines, manifests, skipped=skipped)


@pytest.fixture(scope="session")
def kit() -> SimpleNamespace:
    """Return the constructors of this file, for tests."""
    makers = (PlainLaw, dataset, engine, fit_report, full_run, manifest, markers, study, tube_shapes)
    return SimpleNamespace(**{maker.__name__: maker for maker in makers})
