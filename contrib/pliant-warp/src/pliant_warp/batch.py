"""Chains of one number of joints as worlds of one MuJoCo Warp model, relaxed together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
import warp as wp
from numpy.typing import NDArray

from pliant.errors import UserError
from pliant.interfaces.physics import Case
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.law import JointLaw
from pliant_plugins.physics.mujoco.mjcf import chain_mjcf
from pliant_plugins.physics.quasistatic.loop_laws import LawTable, tabulate
from pliant_warp.config import MujocoWarpConfig
from pliant_warp.kernels import drive, judge

wp.config.quiet = True  # before any of it is loaded: it prints compilations
import mujoco_warp  # noqa: E402

# Numbers of a body that differ between chains; Warp keeps one for each world.
OF_BODIES = ("body_pos", "body_quat", "body_ipos", "body_iquat", "body_inertia", "body_mass", "body_gravcomp")
KINDS = {
    "body_pos": wp.vec3,
    "body_quat": wp.quat,
    "body_ipos": wp.vec3,
    "body_iquat": wp.quat,
    "body_inertia": wp.vec3,
    "body_mass": wp.float32,
    "body_gravcomp": wp.float32,
}
# Steps between two looks at how far the chains still move.
BLOCK = 50
# A block in which no joint has moved further (rad) ends the relaxation.
STILL = 2e-6
BASE = 1  # bodies: world, base, body 1…n, tip


def warp_device(config: MujocoWarpConfig) -> Any:
    """Return Warp's device; raise `UserError` if no device has that name."""
    wp.init()
    names = [str(device) for device in wp.get_devices()]
    if config.device == "auto":
        return wp.get_device(next((name for name in names if name.startswith("cuda")), "cpu"))
    if config.device not in names:
        raise UserError(f"physics.device is '{config.device}'; this machine has {', '.join(names)}.")
    return wp.get_device(config.device)


def suits(case: Case) -> bool:
    """Return whether a case can go into a batch: a hinge chain with one actuator, whose loads act at its end."""
    chain, inputs = case.chain, case.inputs
    one_law = all(law.joint == "revolute" and len(law.actuations) == 1 for law in chain.laws)
    shared = not any(joint.drives for joint in chain.joints) and len(chain.actuators) == 1
    return one_law and shared and not chain.terms and not inputs.forces and not inputs.cords


class Relaxation:
    """Cases with the same number of joints on a device.

    Args:
        cases: each of them `suits`.
        config: settings.
        device: Warp's.
    """

    def __init__(self, cases: Sequence[Case], config: MujocoWarpConfig, device: Any) -> None:
        self.cases, self.config, self.device = cases, config, device
        self.n, count = cases[0].chain.n_joints, len(cases)
        models = _models([case.chain for case in cases])
        data = mujoco.MjData(models[0])
        with wp.ScopedDevice(device):
            self.model = mujoco_warp.put_model(models[0])
            self.data = mujoco_warp.put_data(models[0], data, nworld=count)
            for name in OF_BODIES:
                rows = np.array([getattr(model, name) for model in models], np.float32)
                setattr(self.model, name, wp.array(rows, dtype=KINDS[name]))
            self.model.jnt_axis = wp.array(np.array([m.jnt_axis for m in models], np.float32), dtype=wp.vec3)
            gravity = np.array([case.chain.gravity_m_s2 for case in cases], np.float32)
            self.model.opt.gravity = wp.array(gravity, dtype=wp.vec3)
            self.model.opt.timestep = wp.array(
                np.full(count, config.settle_timestep_s, np.float32), dtype=float
            )
            self.model.dof_damping = wp.zeros((count, self.n), dtype=float)
            self._laws()
            self._loads(models)
            self.before = wp.zeros((count, self.n), dtype=float)
            self.energy, self.moved = wp.zeros(count, dtype=float), wp.zeros(count, dtype=float)
            self.caution = wp.full(count, 1.0, dtype=float)

    def _laws(self) -> None:
        """Build the tables of all laws and their assignment."""
        laws: dict[int, JointLaw] = {id(law): law for case in self.cases for law in case.chain.laws}
        number = {identity: k for k, identity in enumerate(laws)}
        pressures = np.array([_pressure(case) for case in self.cases])
        reach = float(np.abs(pressures).max()) * 1.5 or 1.0
        low = -reach if pressures.min() < 0.0 else -0.25 * reach
        tables: list[LawTable] = [tabulate(law, (low, reach)) for law in laws.values()]
        cells = np.stack([table.cells for table in tables]).astype(np.float32)
        self.cells = wp.array(cells, dtype=wp.mat44)
        self.grids = wp.array(np.stack([table.grid for table in tables]).astype(np.float32), dtype=wp.vec4)
        rows = [[number[id(case.chain.laws[j.law])] for j in case.chain.joints] for case in self.cases]
        self.law = wp.array(np.array(rows, np.int32), dtype=int)
        self.pressure = wp.array(pressures.astype(np.float32), dtype=float)
        signs = np.array([case.chain.actuators[0].sign for case in self.cases], np.float32)
        self.sign = wp.array(signs, dtype=float)

    def _loads(self, models: Sequence[Any]) -> None:
        """End moments, tip forces and a bound of their stiffness: what hangs beyond a joint, times how far it is."""
        moments = np.array([case.inputs.moment_n_m for case in self.cases], np.float32)
        self.moment = wp.array(moments, dtype=float)
        wrench = np.zeros((len(self.cases), self.n + BASE + 2, 6), np.float32)
        wrench[:, -1, :3] = [case.inputs.tip_force_n for case in self.cases]
        self.data.xfrc_applied = wp.array(wrench, dtype=wp.spatial_vector)
        extra = np.array([_bound(case, model) for case, model in zip(self.cases, models, strict=True)])
        self.extra = wp.array(extra.astype(np.float32), dtype=float)

    def run(self) -> tuple[Array, int]:
        """Step until all chains are at rest or the step limit; return joint angles (worlds, n) and the steps."""
        steps = 0
        with wp.ScopedDevice(self.device):
            graph = None
            if self.device.is_cuda:  # a block is recorded once: launching each kernel takes longer than it
                self._step()
                steps += 1
                with wp.ScopedCapture() as capture:
                    self._block()
                graph = capture.graph
            while steps < self.config.batch_steps:
                self.moved.zero_()
                if graph is None:
                    self._block()
                else:
                    wp.capture_launch(graph)
                steps += BLOCK
                if float(self.moved.numpy().max()) <= STILL:
                    break
            return self.data.qpos.numpy().astype(float), steps

    def _block(self) -> None:
        for _ in range(BLOCK):
            self._step()

    def _step(self) -> None:
        data = self.data
        of_laws = [self.cells, self.grids, self.law, self.pressure, self.sign, self.moment, self.extra]
        step = [self.caution, self.config.settle_timestep_s, data.qfrc_applied, self.model.dof_damping]
        wp.launch(drive, self.law.shape, inputs=[data.qpos, *of_laws, *step, self.before])
        mujoco_warp.step(self.model, data)
        watched = [data.qpos, data.qvel, self.before, self.energy, self.caution, self.moved]
        wp.launch(judge, len(self.cases), inputs=watched)


def _models(chains: Sequence[ChainModel]) -> list[Any]:
    """Return MuJoCo's model of each chain; chains that are one object share theirs."""
    made: dict[int, Any] = {}
    for chain in chains:
        if id(chain) not in made:
            model = made[id(chain)] = mujoco.MjModel.from_xml_string(chain_mjcf(chain))
            model.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)  # Warp supports none
    return [made[id(chain)] for chain in chains]


def _pressure(case: Case) -> float:
    return float(case.inputs.actuation[case.chain.actuators[0].input])


def _bound(case: Case, model: Any) -> NDArray[np.float64]:
    """Return (n,) half of Σ force · distance beyond each joint, a bound of the loads' stiffness rows."""
    n, gravity = case.chain.n_joints, float(np.linalg.norm(case.chain.gravity_m_s2))
    weights = gravity * model.body_mass[BASE + 1 :] * (1.0 - model.body_gravcomp[BASE + 1 :])
    weights[-1] = gravity * case.chain.payload_kg + float(np.linalg.norm(case.inputs.tip_force_n))
    lengths = np.linalg.norm(model.body_pos[BASE + 1 :], axis=1)
    along = np.cumsum(lengths)
    return np.array([float(weights[i:] @ (along[i:] - along[i] + lengths[-1])) for i in range(n)])
