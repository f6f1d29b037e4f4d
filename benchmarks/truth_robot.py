"""A truth of the evidence bed as a robot under control: the hinges of any planar-jointed chain in MuJoCo.

Efforts, damping and MuJoCo's step are those of `evidence.mujoco_truth`; here every hinge has a separate pressure, and
the motion follows commands instead of a protocol.
"""

from __future__ import annotations

import mujoco
import numpy as np
from benchmarks.evidence.forms import ROOM_C, Drive, Forms, virgin, viscous_torque
from benchmarks.evidence.functional_truth import Bones, compile_bones, own
from benchmarks.evidence.mujoco_truth import SLOPE_STEP_RAD, STEP_S, Views, _step, mjcf
from benchmarks.evidence.skeleton import Skeleton
from benchmarks.evidence.truths import Truth
from numba import njit

from pliant.interfaces.simulation import Simulation, SimulationState
from pliant.mechanics.kinematics import ChainGeometry
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.rollout import Equilibrium, Inputs

SETTLE_S, STILL_RAD_S = 20.0, 1e-4


def build_skeleton(chain: ChainModel) -> Skeleton:
    """Return the hinges of a chain of revolute joints that hangs along −z, with its masses."""
    straight = ChainGeometry.from_chain(chain).forward(np.zeros((chain.n_joints, 1)))
    bodies = chain.bodies[1:]
    places = straight.origins[1:]
    turns = straight.rotations[1:]
    across = [float(np.linalg.eigvalsh(one.inertia_kg_m2)[-1]) for one in bodies]
    return Skeleton(
        axes=straight.directions[:, :, 0],
        offsets_m=np.diff(places, axis=0, prepend=straight.origins[:1]),
        tip_m=turns[-1] @ np.asarray(chain.tip_offset_m, float),
        masses_kg=np.array([one.mass_kg for one in bodies]),
        centres_m=np.array([turn @ one.com_m for turn, one in zip(turns, bodies, strict=True)]),
        inertias_kg_m2=np.array(across),
        module=np.arange(chain.n_joints),
        spring_n_m=np.zeros((chain.n_joints, 2)),
    )


class TruthSimulation(Simulation):
    """The chain's body with a truth in every joint; inputs are the chain's own, one actuator on each joint."""

    def __init__(self, chain: ChainModel, truth: Truth) -> None:
        self.chain, self._skeleton = chain, build_skeleton(chain)
        self.model = mujoco.MjModel.from_xml_string(mjcf(self._skeleton, truth.body))
        self.data = mujoco.MjData(self.model)
        self.model.opt.gravity[:] = chain.gravity_m_s2
        self._bones = compile_bones(self._skeleton, truth.body, swings=False)
        self._dry, self._viscous = truth.forms._replace(viscous=0.0), truth.forms
        self._memory, self._time_s = virgin(chain.n_joints), 0.0
        self._pressures = np.zeros(chain.n_joints)

    def apply(self, inputs: Inputs) -> None:
        acting = [self.chain.actuators[self.chain.actuator_range(joint)[0]] for joint in self.chain.joints]
        self._pressures = np.array([one.sign * inputs.actuation[one.input] for one in acting])

    def step(self, duration_s: float) -> None:
        model, data = self.model, self.data
        views = (data.qpos, data.qvel, data.qfrc_applied, model.jnt_stiffness, model.dof_damping)
        handles = (model._address, data._address)
        count = max(1, round(duration_s / STEP_S))
        forms = (self._dry, self._viscous)
        _march(handles, views, self._pressures, self._bones, self._memory, count, *forms)
        self._time_s += duration_s

    def settle(self) -> Equilibrium:
        """Wait until lagged quantities have settled."""
        self.step(SETTLE_S)
        rate = float(np.abs(self.data.qvel).max())
        q = self.snapshot().position
        return Equilibrium(q, self.markers(), float("nan"), rate < STILL_RAD_S, None, 1, 0.0)

    def snapshot(self) -> SimulationState:
        q, rates = self.data.qpos.reshape(-1, 1).copy(), self.data.qvel.reshape(-1, 1).copy()
        return SimulationState(self._time_s, q, rates, self._memory.copy())

    def restore(self, state: SimulationState) -> None:
        assert state.memory is not None
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:], self.data.qvel[:] = state.position.ravel(), state.velocity.ravel()
        self._memory, self._time_s = state.memory.copy(), state.time_s

    def markers(self) -> Array:
        mujoco.mj_kinematics(self.model, self.data)
        tip = self.data.xpos[-1] + self.data.xmat[-1].reshape(3, 3) @ self._skeleton.tip_m
        base = np.asarray(self.chain.base_position_m, float)
        return np.vstack([base, base + self.data.xpos[1:], base + tip])


@njit
def _march(
    handles: tuple[int, int],
    views: Views,
    pressures: Array,
    bones: Bones,
    memory: Array,
    count: int,
    f: Forms,
    viscous: Forms,
) -> None:
    """Make `count` steps at constant pressures. See `mujoco_truth._advance`."""
    position, velocity, force, stiffness, damping = views
    n = len(position)
    before, new = np.empty(n), memory.copy()
    for _ in range(count):
        for j in range(n):
            u = position[j]
            at = Drive(pressures[j], 0.0, ROOM_C, 0.0, 0.0, 0.0, 0.0, 0.0)
            value = own(j, u, 0.0, STEP_S, at, memory[j], new[j], bones, f)
            nearby = own(j, u + SLOPE_STEP_RAD, SLOPE_STEP_RAD, STEP_S, at, memory[j], new[j], bones, f)
            slope = max((value - nearby) / SLOPE_STEP_RAD, 0.0)
            before[j], stiffness[j] = u, slope
            damping[j] = bones.damping + viscous_torque(velocity[j], viscous)
            force[j] = value + slope * u
        _step(handles[0], handles[1])
        for j in range(n):
            at = Drive(pressures[j], 0.0, ROOM_C, 0.0, 0.0, 0.0, 0.0, 0.0)
            own(j, position[j], position[j] - before[j], STEP_S, at, memory[j], new[j], bones, f)
            memory[j, :] = new[j]
