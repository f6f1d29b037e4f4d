"""A chain on an external arm: one MuJoCo model in which both move and settle.

A motion is MuJoCo's own, in steps no longer than the arm's. For a rest, all dofs together go down the potential of
arm, servos, weights and laws: from rest, M v = h f(q + h v) linearised,

    (M / h² + K) Δq = f(q),   K = −∂f/∂q by central differences,

with f the efforts that nothing balances at q without velocity. The steps h grow as f falls, so that it ends as Newton's
method does.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from pliant.interfaces.simulation import SimulationState
from pliant.mechanics.statics import ChainStatics, Loads, unstable_mode
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.mount import Carrier
from pliant.records.rollout import Equilibrium
from pliant_plugins.physics.mujoco.config import MujocoConfig
from pliant_plugins.physics.mujoco.mount import ONE_COORDINATE, MountedArm
from pliant_plugins.physics.mujoco.simulation import MujocoSimulation
from pliant_plugins.physics.mujoco.warned import silent

DIFFERENCE = 1e-6  # rad or m
FIRST_STEP_S, LONGEST_STEP_S = 0.02, 1e6
LONGEST_MOVE = 0.4  # rad or m in one step
MOST_STEPS = 400
NUDGE = 1e-3
# Efforts of MuJoCo's constraints (limits, welds, contacts) are as exact as its solver.
OF_CONSTRAINTS = 1e-6


class MountedSimulation(MujocoSimulation):
    """See the module. Everything outside is in the world frame; `ChainModel`'s base pose is in the mount's."""

    def __init__(self, chain: ChainModel, config: MujocoConfig) -> None:
        assert chain.mount is not None
        self._arm = arm = MountedArm.from_mount(chain.mount)
        model, prefix = arm.with_chain(chain)
        longest_s = min(config.timestep_s, float(model.opt.timestep))
        super().__init__(chain, config.model_copy(update={"timestep_s": longest_s}), model, prefix)
        joints, a = self.joints, len(chain.axes)
        self._places = _others(model.nq, joints.coordinate, joints.n_joints * joints.width)
        self._dofs = _others(model.nv, joints.dof, joints.n_joints * a)
        self._bodies = _others(model.nbody, joints.base, joints.tip + 1 - joints.base)
        self.data.ctrl[:], self.data.act[:] = arm.ctrl, arm.act
        self._begin()
        mujoco.mj_kinematics(model, self.data)
        self._first_m = self._frame()[0].copy()
        kinds = arm.model.jnt_type.tolist()
        one = [k for k, kind in enumerate(kinds) if kind in ONE_COORDINATE]
        self._names = tuple(
            f"{arm.model.joint(k).name or f'joint_{k}'}_{ONE_COORDINATE[kinds[k]]}" for k in one
        )
        self._seen = self._places[[int(arm.model.jnt_qposadr[k]) for k in one]]

    def _begin(self) -> None:
        """Set the arm to its first pose, without velocity."""
        self.data.qpos[self._places], self.data.qvel[self._dofs] = self._arm.qpos, 0.0
        self.data.qacc_warmstart[:] = 0.0

    def _frame(self) -> tuple[Array, Array]:
        """Return origin (3,) and attitude (3, 3) of the mount by the present kinematics."""
        at, data = self._arm.mount.at, self.data
        if mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_SITE, at) >= 0:
            return data.site(at).xpos, data.site(at).xmat.reshape(3, 3)
        return data.body(at).xpos, data.body(at).xmat.reshape(3, 3)

    def carrier(self) -> Carrier:
        data = self.data
        mujoco.mj_kinematics(self.model, data)
        place, rotation = self._frame()
        return Carrier(
            self._names,
            data.qpos[self._seen].copy(),
            place.copy(),
            rotation.copy(),
            place - self._first_m,
            data.xpos[self._bodies].copy(),
            data.xmat[self._bodies].reshape(-1, 3, 3).copy(),
        )

    def _drive(self, loads: Loads, *how: Any) -> None:
        self.data.qfrc_applied[:] = 0.0  # point loads act on the arm's dofs too
        super()._drive(loads, *how)

    def halt(self, q: Array) -> None:
        super().halt(q)
        self.data.qvel[:] = 0.0

    def snapshot(self) -> SimulationState:
        state, data = super().snapshot(), self.data
        own = np.concatenate([data.qpos[self._places], data.qvel[self._dofs], data.act])
        return SimulationState(state.time_s, state.position, state.velocity, state.memory, own)

    def restore(self, state: SimulationState) -> None:
        super().restore(state)
        self._begin()
        if state.carrier is None:
            self.data.act[:] = self._arm.act
            return
        cuts = np.cumsum([len(self._places), len(self._dofs)])
        places, rates, activations = np.split(state.carrier, cuts)
        self.data.qpos[self._places], self.data.qvel[self._dofs] = places, rates
        self.data.act[:] = activations

    def settle(self) -> Equilibrium:
        start = time.perf_counter()
        loads, efforts = self.now(), self.statics.efforts
        with silent(), self._without_dry_friction():
            converged, steps = self._descend(loads)
            force = self._unbalanced(loads)
            carrying = np.intersect1d(self._dofs, self._coupled(), assume_unique=True)
            own = float(np.abs(force[carrying]).max(initial=0.0))
        q = self.q
        if self.chain.terms:
            self._memory = efforts.advance(q, loads.actuation, self._memory)
        carrier = self.carrier()
        turned = carrier.rotation @ np.asarray(self.chain.base_rotation, float)
        placed = self.chain.with_(
            base_position_m=carrier.in_world(np.asarray(self.chain.base_position_m, float)),
            base_rotation=turned,
        )
        chains = float(np.abs(ChainStatics(placed).residual(q, loads)).max())
        return Equilibrium(
            joint_angles=q,
            markers_m=self.markers(),
            residual=max(own, chains),
            converged=converged,
            stable=converged,
            iterations=steps,
            wall_s=time.perf_counter() - start,
            outside_domain=efforts.outside_domain(q, loads.actuation, self._time_s),
            carrier=carrier,
        )

    @contextmanager
    def _without_dry_friction(self) -> Iterator[None]:
        """Disable MuJoCo's dry friction, which creeps under any force and so carries nothing at rest."""
        flags = self.model.opt.disableflags
        self.model.opt.disableflags = flags | int(mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS)
        try:
            yield
        finally:
            self.model.opt.disableflags = flags

    def _unbalanced(self, loads: Loads) -> Array:
        """Return the (nv,) unbalanced efforts at rest in the present pose."""
        self.data.qvel[:] = 0.0
        self._drive(loads, 0.0)
        mujoco.mj_forward(self.model, self.data)
        return np.asarray(self.data.qfrc_smooth + self.data.qfrc_constraint)

    def _coupled(self) -> NDArray[np.intp]:
        """Return the dofs of the arm and of bodies in contact with it or tied to it; other objects do not move."""
        model, data = self.model, self.data
        trees = model.dof_treeid
        if model.neq or model.ntendon:
            return np.arange(model.nv)
        pairs = (
            model.body_treeid[model.geom_bodyid[data.contact.geom]] if data.ncon else np.empty((0, 2), int)
        )
        own = {int(trees[self.joints.dof])}
        while True:
            met = {int(tree) for pair in pairs if own & set(pair.tolist()) for tree in pair if tree >= 0}
            if met <= own:
                return np.flatnonzero(np.isin(trees, list(own)))
            own |= met

    def _stiffness(self, loads: Loads, dofs: NDArray[np.intp]) -> Array:
        """Return (k, k) the negative slope of the unbalanced efforts of these dofs."""
        here, found = self.data.qpos.copy(), np.empty((len(dofs), len(dofs)))
        for k, way in enumerate(np.eye(self.model.nv)[dofs]):
            sides = []
            for step in (DIFFERENCE, -DIFFERENCE):
                mujoco.mj_integratePos(self.model, self.data.qpos, way, step)
                sides.append(self._unbalanced(loads)[dofs])
                self.data.qpos[:] = here
            found[:, k] = (sides[1] - sides[0]) / (2.0 * DIFFERENCE)
        return found

    def _mass(self) -> Array:
        """Return the (nv, nv) mass matrix; the signature of MuJoCo's `mj_fullM` depends on the version."""
        columns, column = [], np.empty(self.model.nv)
        for way in np.eye(self.model.nv):
            mujoco.mj_mulM(self.model, self.data, column, way)
            columns.append(column.copy())
        return np.array(columns)

    def _descend(self, loads: Loads) -> tuple[bool, int]:
        """Move to rest; whether a minimum was reached, and in how many steps."""
        data, step_s, before = self.data, FIRST_STEP_S, np.inf
        for count in range(MOST_STEPS):
            whole = self._unbalanced(loads)
            dofs = self._coupled()
            force = whole[dofs]
            size = float(np.abs(force).max())
            if not np.isfinite(size):
                return False, count
            stiffness = self._stiffness(loads, dofs)
            if self._is_balanced(whole, dofs):
                mode = unstable_mode(stiffness)
                if mode is None:
                    return True, count
                move = NUDGE * mode / np.abs(mode).max()
            else:
                step_s = min(step_s * float(np.clip(before / size, 0.5, 4.0)), LONGEST_STEP_S)
                metric = self._mass()[np.ix_(dofs, dofs)] / step_s**2 + stiffness
                try:
                    move = np.linalg.solve(metric, force)
                except np.linalg.LinAlgError:
                    move = np.linalg.lstsq(metric, force)[0]
                if float(move @ force) < 0.0:  # uphill, where the stiffness is not positive: a shorter step
                    step_s *= 0.1
                    continue
                longest = float(np.abs(move).max())
                if longest > LONGEST_MOVE:
                    move *= LONGEST_MOVE / longest
            change = np.zeros(self.model.nv)
            change[dofs] = move
            mujoco.mj_integratePos(self.model, data.qpos, change, 1.0)
            before = size
        return False, MOST_STEPS

    def _is_balanced(self, force: Array, dofs: NDArray[np.intp]) -> bool:
        """Return whether the chain's dofs are within the tolerance, the arm's within that share of its loads."""
        tolerance = np.full(self.model.nv, self._config.tolerance)
        carried = max(1.0, float(np.abs(self.data.qfrc_bias).max()))
        tolerance[self._dofs] = OF_CONSTRAINTS if self.data.nefc else self._config.tolerance * carried
        return bool((np.abs(force) <= tolerance)[dofs].all())


def _others(count: int, first: int, own: int) -> Any:
    """Return numbers below `count` that are not among the `own` from `first` on."""
    return np.r_[0:first, first + own : count]
