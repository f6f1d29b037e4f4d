"""The engine: MuJoCo on the CPU for one chain, MuJoCo Warp for batches."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np

from pliant.interfaces.physics import Capabilities, Case
from pliant.mechanics.statics import ChainStatics, Loads, unstable_mode
from pliant.records.design import Array
from pliant.records.rollout import Equilibrium
from pliant_plugins.physics.mujoco.backend import Mujoco
from pliant_plugins.physics.quasistatic.batch import settle_together
from pliant_plugins.physics.quasistatic.compiled_solver import Packs
from pliant_plugins.physics.quasistatic.newton import NewtonOptions
from pliant_warp.batch import Relaxation, suits, warp_device
from pliant_warp.config import MujocoWarpConfig

FREE_TURN = 1.0  # rad; no step is made


class MujocoWarp(Mujoco):
    """MuJoCo; batches of hinge chains with one actuator each settle together on Warp's device, in single precision.

    Other cases of a batch (law terms, several actuators, cords, balls and slides) settle one by one, as in `mujoco`,
    and so does a chain that a batch leaves at an equilibrium that is no minimum.
    """

    capabilities: ClassVar[Capabilities] = Capabilities(("revolute", "spherical", "prismatic"), dynamic=True)
    config: MujocoWarpConfig

    def settle_batch(self, cases: Sequence[Case]) -> tuple[Equilibrium, ...]:
        """Settle each chain from its straight state, chains with the same number of joints together."""
        groups: dict[int, list[int]] = {}
        for k, case in enumerate(cases):
            if suits(case):
                groups.setdefault(case.chain.n_joints, []).append(k)
        found: dict[int, Equilibrium] = {}
        for numbers in groups.values():
            found |= self._together({k: cases[k] for k in numbers})
        alone = [k for k in range(len(cases)) if k not in found]
        found |= dict(zip(alone, super().settle_batch([cases[k] for k in alone]), strict=True))
        return tuple(found[k] for k in range(len(cases)))

    def _together(self, cases: dict[int, Case]) -> dict[int, Equilibrium]:
        started, every = time.perf_counter(), list(cases.values())
        angles, steps = Relaxation(every, self.config, warp_device(self.config)).run()
        each_s = (time.perf_counter() - started) / len(cases)
        # Newton's method without a step is a verdict, and a compiled one: minima within the tolerance.
        verdict = NewtonOptions(self.config.batch_tolerance, 0, FREE_TURN)
        ends = [q[:, None] for q in angles]
        minima = settle_together(every, Packs().laws, verdict, ends)
        judged: dict[int, Equilibrium | None] = {}
        for place, (k, case) in enumerate(cases.items()):
            there = minima.get(place)
            if there is not None and there.iterations == 0:
                judged[k] = replace(there, iterations=steps, wall_s=each_s)
            else:
                judged[k] = self._judged(case, ends[place], steps, each_s)
        return {k: one for k, one in judged.items() if one is not None}

    def _judged(self, case: Case, q: Array, steps: int, wall_s: float) -> Equilibrium | None:
        """Check the state with the common statics in double precision; None if it is balanced but no minimum."""
        statics, loads = ChainStatics(case.chain), Loads.from_inputs(case.chain, case.inputs)
        residual = float(np.abs(statics.residual(q, loads)).max())
        converged = residual <= self.config.batch_tolerance
        if converged and unstable_mode(statics.balance(q, loads).stiffness) is not None:
            return None
        return Equilibrium(
            joint_angles=q,
            markers_m=statics.geometry.markers(q),
            residual=residual,
            converged=converged,
            stable=converged,
            iterations=steps,
            wall_s=wall_s,
            outside_domain=statics.efforts.outside_domain(q, loads.actuation, 0.0),
        )
