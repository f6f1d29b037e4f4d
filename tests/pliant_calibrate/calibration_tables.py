"""Bench tables generated from a law, and a module whose free curve is known in closed form."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from pliant.config.study import Study
from pliant.interfaces.material import MaterialConfig
from pliant.mechanics.homogeneous import incompressible_stress, nominal_stress
from pliant.records.fem import FemState
from pliant.registry.discovery import discover

REGISTRY = discover()


def config(kind: str, **keys: Any) -> MaterialConfig:
    model = REGISTRY.get("material", kind).config_model()
    return model.model_validate({"kind": kind, **keys})


def study(kind: str, **keys: Any) -> Study:
    return Study(name="x", material=config(kind, **keys))


def stress(material: MaterialConfig, stretch: np.ndarray, mode: str = "uniaxial") -> np.ndarray:
    """Return the nominal stress of the incompressible solid of this material at a stretch."""
    return incompressible_stress(REGISTRY.build("material", material), stretch, mode)  # type: ignore[arg-type]


def write(path: Path, header: str, *columns: Any) -> Path:
    rows = [",".join(str(cell) for cell in row) for row in zip(*columns, strict=True)]
    path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    return path


class Bar:
    """A "module" that is a bar: u is its nominal strain, p = κ P(1 + u) + k_ribbon u."""

    LEVER = 0.2

    STRAINS = np.linspace(-0.05, 1.5, 160)

    def __init__(self, material: Any, ribbon_pa: float) -> None:
        self.solved = 0
        stresses = nominal_stress(material, 1 + self.STRAINS)
        self.pressure = CubicSpline(self.STRAINS, self.LEVER * stresses + ribbon_pa * self.STRAINS)

    def _state(self, p: float, u: float) -> FemState:
        self.solved += 1
        slope = float(self.pressure(u, 1))
        others = {"energy_j": 0.0, "travel": 0.0, "axial_strain": 0.0, "branch": "free", "status": "ok"}
        return FemState.from_one_axis(p, u, 0.0, 1.0, -slope, iterations=1, wall_s=0.0, **others)

    def rest(self) -> FemState:
        return self._state(0.0, 0.0)

    def free(self, p: float, start: FemState) -> FemState:
        u = start.angle_rad
        for _ in range(50):
            u += (p - float(self.pressure(u))) / float(self.pressure(u, 1))
        return self._state(p, u)


class BarBench:
    """A workbench with the bar as family and FEM."""

    def __init__(self, ribbon_pa: float = 0.0) -> None:
        from pliant.execution.progress import Silent

        self.progress, self.ribbon_pa, self.registry = Silent(), ribbon_pa, REGISTRY
        self.solvers: list[Bar] = []

    def build(self, interface: str, block: Any) -> Any:
        if interface == "material":
            return REGISTRY.build("material", block)
        problem = SimpleNamespace(
            ribbons=(1,) if self.ribbon_pa else (),
            mesh=SimpleNamespace(regions={}),
            joint="revolute",
            actuation="pressure_pa",
        )
        if interface == "family":
            return SimpleNamespace(main_axis="y", problem=lambda refinement, axes: problem)
        return SimpleNamespace(checked_solver=self._solver)

    def _solver(self, problem: Any, material: Any) -> Bar:
        self.solvers.append(Bar(material, self.ribbon_pa))
        return self.solvers[-1]

    @property
    def solved(self) -> int:
        return sum(bar.solved for bar in self.solvers)
