"""Where convolutions touch: the data end there, or they are let pass and the states say so."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pliant.execution.progress import Silent
from pliant.interfaces.fem import FemConfig, Held, ModuleSolver
from pliant.pipeline.sampling.plan import sample
from pliant.pipeline.sampling.walk import MAIN, Piece
from pliant.records.design import Array
from pliant.records.fem import FemState

TOUCHING_RAD = 0.3


class Touching(ModuleSolver):
    """τ = p − 20 u − 5 u³, up to 10 Pa; convolutions overlap beyond 0.3 rad."""

    def _state(self, p: float, u: float, branch: str) -> FemState:
        return FemState.of_one_axis(
            p,
            u,
            p - 20 * u - 5 * u**3,
            1.0,
            -20.0 - 15 * u**2,
            energy_j=0.0,
            travel=0.0,
            axial_strain=0.0,
            branch=branch,
            status="self_contact" if u > TOUCHING_RAD else "ok",
            iterations=1,
            wall_s=0.0,
            solution=np.array([p, u]),
        )

    def rest(self) -> FemState:
        return self._state(0.0, 0.0, "free")

    def free(self, actuation: float, start: FemState) -> FemState:
        roots = np.roots([5.0, 0.0, 20.0, -actuation])
        return self._state(actuation, float(roots[np.abs(roots.imag) < 1e-9].real[0]), "free")

    def constrained(self, actuation: float, held: Held, start: FemState) -> FemState:
        assert isinstance(held, float)
        return self._state(actuation, held, "constrained")

    def deformed_nodes(self, state: FemState) -> Array:
        return np.zeros((1, 3))


def angles(
    tmp_path: Path, self_contact: str, limits: tuple[float, float] = (-np.inf, np.inf)
) -> tuple[list[float], set[str]]:
    config = FemConfig.model_validate({"kind": "any", "pressure_max_pa": 10.0, "self_contact": self_contact})
    pieces = [Piece(MAIN, Touching(), ("y",), "y", limits)]
    solved = sample(pieces, config, 10.0, tmp_path, Silent()).solved
    kept = [one.state for one in solved if one.state.trusted and one.state.branch == "constrained"]
    return [state.angle_rad for state in kept], {one.state.status for one in solved}


def test_the_data_end_where_convolutions_touch(tmp_path: Path) -> None:
    trusted, statuses = angles(tmp_path, "stop")
    assert max(trusted) <= TOUCHING_RAD
    assert statuses == {"ok", "self_contact"}


def test_convolutions_may_pass_and_their_states_are_marked(tmp_path: Path) -> None:
    trusted, statuses = angles(tmp_path, "pass")
    assert max(trusted) > 0.5
    assert statuses == {"ok", "passed_through"}


def test_what_rigid_parts_forbid_is_never_let_pass(tmp_path: Path) -> None:
    """The free branch goes to 0.48 rad, beyond the limit; the box of the others ends at it."""
    trusted, statuses = angles(tmp_path, "pass", (-0.2, 0.4))
    assert max(trusted) == 0.4 and min(trusted) == -0.2
    assert statuses == {"ok", "passed_through", "self_contact"}
