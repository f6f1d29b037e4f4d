"""A plugin file: the skfem backend, each of whose solves writes `begin` and `end` into the file $SPRINGS_LOG."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any, Literal

from benchmarks.solved_log import note

from pliant.interfaces.material import Material
from pliant.records.fem import FemState, ModuleProblem
from pliant.registry.component import Component
from pliant.registry.hookspecs import hookimpl
from pliant_plugins.fem.config import SkfemConfig
from pliant_plugins.fem.skfem.backend import Skfem, SkfemSolver

CONTRACT = 3


class CountedConfig(SkfemConfig):
    """The config of `skfem` under another kind."""

    kind: Literal["counted_skfem"] = "counted_skfem"


class Counted(Skfem):
    """Skfem with a log."""

    def solver(self, problem: ModuleProblem, material: Material) -> SkfemSolver:
        solver = super().solver(problem, material)
        design = f"{problem.span_m!r}/{problem.mesh.nodes_m.sum()!r}"
        for name in ("rest", "free", "constrained"):
            setattr(solver, name, _logged(getattr(solver, name), f"{design} {name}"))
        return solver


def _logged(solve: Callable[..., FemState], what: str) -> Callable[..., FemState]:
    def logged(*arguments: Any) -> FemState:
        target = ":".join(repr(a) for a in arguments if not isinstance(a, FemState))
        note(f"begin {os.getpid()} {what}:{target}")
        state = solve(*arguments)
        note(f"end {os.getpid()} {what}:{target}")
        return state

    return logged


@hookimpl
def pliant_components() -> list[Component]:
    """Return the backend."""
    here = (f"{__name__}:CountedConfig", f"{__name__}:Counted")
    return [Component("fem", "counted_skfem", *here, "skfem with a log", {"pressure_max": "15 kPa"})]
