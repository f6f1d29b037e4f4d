"""Histories of any chain by stepping a simulation: slow, for joints that the compiled loop does not have."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from pliant.errors import UserError
from pliant.interfaces.physics import Simulation, Variation
from pliant.mechanics.kinematics import base_rotations
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.history import Followed, History

Paths = tuple[tuple[Followed, ...], tuple[tuple[Followed, ...], ...]]
Builder = Callable[[ChainModel], Simulation]


def step_through(
    build: Builder, chain: ChainModel, histories: Sequence[History], towards: Sequence[Variation]
) -> Paths:
    """See `PhysicsBackend.follow`.

    Raises:
        UserError: damage that goes on from run to run, or a base or payload that changes within a run.
    """
    if any(term.keeps for term in chain.terms):
        raise UserError(f"effects with lasting damage are not followed on {chain.laws[0].joint} joints yet")
    paths = tuple(_one(build, chain, history) for history in histories)
    changed = [tuple(_one(build, v.chain, history) for history in v.histories) for v in towards]
    return paths, tuple(_difference(moved, paths) for moved in changed)


def _one(build: Builder, chain: ChainModel, history: History) -> Followed:
    rotation = base_rotations(np.asarray(chain.base_rotation, float), history.base_angles_rad[:1])[0]
    payload = chain.payload_kg if history.payload_kg is None else float(history.payload_kg[0])
    if np.ptp(history.base_angles_rad, axis=0).any() or (
        history.payload_kg is not None and np.ptp(history.payload_kg) > 0.0
    ):
        raise UserError(
            f"run '{history.run}': base and payload must stay as they are within a run of "
            f"{chain.laws[0].joint} joints; split it"
        )
    q: list[Array] = []
    converged: list[bool] = []
    with build(chain.with_(base_rotation=rotation, payload_kg=payload)) as simulation:
        for k in range(len(history)):
            simulation.apply(history.at(k))
            if k and history.time_s is not None:
                simulation.step(float(history.time_s[k] - history.time_s[k - 1]))
                converged.append(True)
            else:
                converged.append(simulation.settle().converged)
            q.append(simulation.snapshot().position)
    return Followed(np.array(q), np.array(converged))


def _difference(moved: Sequence[Followed], paths: Sequence[Followed]) -> tuple[Followed, ...]:
    return tuple(
        Followed(a.joint_angles - b.joint_angles, b.converged) for a, b in zip(moved, paths, strict=True)
    )
