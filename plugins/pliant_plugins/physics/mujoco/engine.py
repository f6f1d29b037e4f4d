"""A chain alone in MuJoCo: it moves in real time, or relaxes in pseudo-time."""

from __future__ import annotations

import math
import warnings

import mujoco
import numpy as np

from pliant.mechanics.inertia import longest_explicit_step, mass_matrix, regular
from pliant.mechanics.statics import ChainStatics, Loads
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant_plugins.physics.mujoco.config import MujocoConfig
from pliant_plugins.physics.mujoco.joints import ChainJoints
from pliant_plugins.physics.mujoco.mjcf import INERTIA_FLOOR_KG_M2, MASS_FLOOR_KG, chain_mjcf

FALLBACK = "mujoco {} has no integrator 'discrete' (3.13 or later has): using implicitfast with shorter steps"


def has_discrete_integrator() -> bool:
    """Whether this MuJoCo takes joint stiffness implicitly."""
    return hasattr(mujoco.mjtIntegrator, "mjINT_DISCRETE")


class MujocoChain:
    """The compiled model and its data."""

    def __init__(self, chain: ChainModel, statics: ChainStatics, config: MujocoConfig) -> None:
        self.statics = statics
        self._config = config
        self._chain = chain
        self.implicit = has_discrete_integrator()
        if not self.implicit:
            warnings.warn(FALLBACK.format(mujoco.__version__), RuntimeWarning, stacklevel=2)
        document = chain_mjcf(chain, "discrete" if self.implicit else "implicitfast")
        self.model = mujoco.MjModel.from_xml_string(document)
        self.data = mujoco.MjData(self.model)
        self.joints = ChainJoints(self.model, self.data, chain, statics)
        self._heard: list[str] = []
        self._listener = None

    @property
    def q(self) -> Array:
        """(n, a) joint coordinates."""
        return self.joints.q

    @property
    def rates(self) -> Array:
        """(n, a) dq/dt."""
        return self.joints.rates

    def place(self, q: Array, rates: Array) -> None:
        """Set joint coordinates and their rates."""
        self.joints.place(q, rates)

    def set_stepping(self, timestep_s: float, damping: float) -> None:
        """Length of the next steps, and the viscous damping of every joint coordinate in them."""
        self.model.opt.timestep = timestep_s
        self.model.dof_damping[:] = damping
        self.model.dof_armature[:] = 0.0

    def stable_step(self, loads: Loads, damping: float) -> float:
        """Longest step of an integrator that does not know the laws' slopes."""
        pieces = tuple(regular(body, MASS_FLOOR_KG, INERTIA_FLOOR_KG_M2) for body in self._chain.bodies)
        mass = mass_matrix(self._chain.with_(bodies=pieces), self.q)
        return longest_explicit_step(mass, self.statics.balance(self.q, loads).stiffness, damping)

    def advance(
        self, loads: Loads, q: Array, extra_stiffness: Array | None = None, caution: float = 1.0
    ) -> None:
        """One step of `model.opt.timestep` from coordinates q, which are the present ones; see `drive`."""
        stiffness = self.joints.drive(loads, q, extra_stiffness, caution, self.implicit)
        if not self.implicit and extra_stiffness is not None:
            # Without implicit stiffness the relaxation moves against inertia of the same size.
            per_dof = np.repeat(stiffness, self.model.nv // len(stiffness))
            self.model.dof_armature[:] = self.model.opt.timestep**2 * per_dof
        mujoco.mj_step(self.model, self.data)

    def halt(self, q: Array) -> None:
        """Put the chain at q without velocity."""
        self.place(q, np.zeros_like(q))

    def begin_relaxing(self) -> None:
        """Pseudo-time of the settle step, without physical damping.

        What MuJoCo says of bold moves is not passed on: they are undone, and the end is judged by the statics.
        """
        self.set_stepping(self._config.settle_timestep_s, damping=0.0)
        self._listen()

    def end_relaxing(self) -> None:
        """`travel` sets its own step, damping and armature."""
        self._stop_listening()

    def travel(self, loads: Loads, duration_s: float) -> None:
        """Advance in real time in equal steps no longer than the config's (without implicit stiffness: stable).

        Where MuJoCo calls the motion unstable, that is a RuntimeWarning.
        """
        damping, longest = self._config.joint_damping, self._config.timestep_s
        if not self.implicit:
            longest = min(longest, self.stable_step(loads, damping))
        n_steps = max(1, math.ceil(duration_s / longest - 1e-9))
        self.set_stepping(duration_s / n_steps, damping)
        self._listen()
        try:
            for _ in range(n_steps):
                self.advance(loads, self.q)
        finally:
            heard = self._stop_listening()
        if heard:
            warnings.warn(f"mujoco: {heard[0]}", RuntimeWarning, stacklevel=2)

    def _listen(self) -> None:
        """Hear MuJoCo's warnings, which it would print and append to a MUJOCO_LOG.TXT in the present folder."""
        self._heard = []
        self._listener = mujoco.get_mju_user_warning()
        mujoco.set_mju_user_warning(self._heard.append)

    def _stop_listening(self) -> list[str]:
        mujoco.set_mju_user_warning(self._listener)
        return self._heard

    def close(self) -> None:
        """MuJoCo frees its memory with the object."""

    def relax_step(self, loads: Loads, q: Array, load_stiffness: Array, caution: float) -> None:
        """One pseudo-time step (`pliant.mechanics.relaxation`): the loads' stiffness is made implicit too."""
        self.advance(loads, q, load_stiffness, caution)

    def markers(self) -> Array:
        """(n + 2, 3) base, joints and tip from MuJoCo's own kinematics."""
        mujoco.mj_kinematics(self.model, self.data)
        return self.joints.markers()
