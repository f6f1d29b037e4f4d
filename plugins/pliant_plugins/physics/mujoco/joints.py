"""The joints of one chain inside a MuJoCo model: reading and setting coordinates, efforts of the laws at the dofs.

A ball joint's dofs are the angular velocity ω in the child's frame, dφ/dt = Jᵣ⁻¹ ω; an effort τ conjugate to
φ is the torque Jᵣ⁻ᵀ τ there, so the work is the same in both coordinates. An extensible joint is a ball and a slide.

Law terms depend on rate and memory, T(u) = τ(u, (u − q)/h, …), and are evaluated at the end of the step. Linearised at
the extrapolated u* = q + h v:  T(q + h v⁺) ≈ T(u*) − K h (v⁺ − v),  K = −dT/du there, in which a rate's slope is c/h.
So the force is T(u*) + h K v, in addition to the damping h K that MuJoCo applies to v⁺: a dashpot T = −c v gives no
force and the damping c, counted once.
"""

from __future__ import annotations

import math
from dataclasses import replace

import mujoco
import numpy as np

from pliant.mechanics.kinematics import Pose
from pliant.mechanics.rotations import (
    quaternion_from_vector,
    right_jacobian,
    right_jacobian_inverse,
    vector_from_quaternion,
)
from pliant.mechanics.statics import ChainStatics, Loads
from pliant.mechanics.terms import TermMemory
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant_plugins.physics.compiled.laws import CompiledLaws, compiled_terms
from pliant_plugins.physics.compiled.motion import drive, remember
from pliant_plugins.physics.mujoco.mjcf import JOINT_TYPES

NOT_NEEDED = np.empty(0)


class ChainJoints:
    """Views of a chain's part of `model` and `data`; its bodies' names begin with `prefix`."""

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        chain: ChainModel,
        statics: ChainStatics,
        prefix: str = "",
    ) -> None:
        self.statics = statics
        self._geometry = statics.geometry
        self.ball, self._slides = (
            JOINT_TYPES[self._geometry.kind][0] == "ball",
            self._geometry.slide is not None,
        )
        self.n_axes = a = len(chain.axes)
        self.model, self._data = model, data
        self.base, self.tip = model.body(f"{prefix}base").id, model.body(f"{prefix}tip").id
        n, first = chain.n_joints, int(model.body_jntadr[self.base + 1])
        self.n_joints, self.main = n, statics.geometry.main
        self.coordinate, self.dof = int(model.jnt_qposadr[first]), int(model.jnt_dofadr[first])
        self.width = a + 1 if self.ball else a  # coordinates of a joint: a quaternion has one more
        dofs = slice(self.dof, self.dof + n * a)
        self._qpos = data.qpos[self.coordinate : self.coordinate + n * self.width]
        self._qvel, self._applied = data.qvel[dofs], data.qfrc_applied[dofs]
        self._damping = model.dof_damping[dofs]
        if self.ball:
            self._qpos, self._qvel = self._qpos.reshape(n, self.width), self._qvel.reshape(n, a)
            self._applied, self._damping = self._applied.reshape(n, a), self._damping.reshape(n, a)
        self._reach = self._geometry.relative_reach
        axes = np.resize(np.argmax(self._geometry.basis, axis=0), 3)
        self.layout = (self.ball, axes, self.main, float(self._reach[-1]))
        # Compiled forms, None where a law or a term has none.
        compiled = CompiledLaws.from_chain(chain)
        self.laws = None if compiled is None else compiled.arrays
        self.terms = compiled_terms(chain.terms, n)
        self._has_terms, self._none = bool(chain.terms), np.zeros(n)
        self._still = (np.zeros((n, len(chain.axes))), np.zeros(0))
        self._views = self.views()[:4]
        self._loads: Loads | None = None
        self._values = self._none

    @property
    def q(self) -> Array:
        """(n, a) joint coordinates."""
        return self.coordinates(self._qpos)

    def coordinates(self, qpos: Array) -> Array:
        """Return (…, n, a) joint coordinates of MuJoCo's (…, n), of balls (…, n, 4), with a slide (…, n, 5)."""
        if not self.ball:
            return qpos[..., None].copy()
        q = np.asarray(vector_from_quaternion(qpos[..., :4]) @ self._geometry.basis)
        return self._with_slide(q, qpos[..., -1])

    def _with_slide(self, values: Array, slides: Array) -> Array:
        """Return the values with `slides` (…) in their last column, the extension, if there is one."""
        if self._slides:
            values[..., -1] = slides
        return values

    @property
    def rates(self) -> Array:
        """(n, a) rates dq/dt of the joint coordinates."""
        if not self.ball:
            return self._qvel.reshape(-1, 1).copy()
        inverse = right_jacobian_inverse(vector_from_quaternion(self._qpos[:, :4]))
        rates: Array = np.einsum("nij,nj->ni", inverse, self._qvel[:, :3])
        return self._with_slide(rates @ self._geometry.basis, self._qvel[:, -1])

    def place(self, q: Array, rates: Array) -> None:
        """Set joint coordinates and their rates."""
        if self.ball:
            phi, phi_rate = self._geometry.rotation_vectors(q), self._geometry.rotation_vectors(rates)
            self._with_slide(self._qpos, q[:, -1])[:, :4] = quaternion_from_vector(phi)
            self._with_slide(self._qvel, rates[:, -1])[:, :3] = np.einsum(
                "nij,nj->ni", right_jacobian(phi), phi_rate
            )
        else:
            self._qpos[:], self._qvel[:] = q.ravel(), rates.ravel()

    def slow(self, kept: float) -> None:
        """Leave this share of every velocity."""
        self._views[1][:] *= kept

    def views(self) -> tuple[Array, ...]:
        """Return flat views of MuJoCo's coordinates, velocities, forces, damping, tip force and body positions."""
        flat = [part.reshape(-1) for part in (self._qpos, self._qvel, self._applied, self._damping)]
        bodies = slice(self.base, self.tip + 1)
        return (*flat, self._data.xfrc_applied[self.tip, :3], self._data.xpos[bodies])

    def drive(
        self, loads: Loads, damping: float, extra_stiffness: Array | None = None, caution: float = 1.0
    ) -> None:
        """Apply the forces of laws and loads for the next step at the present state.

        The force at the joints is exactly the laws' τ. Their local slope k enters as a damping h k in addition to the
        physical one; MuJoCo treats it implicitly, so that the stiffness is implicit too (`compiled.motion`). With
        `extra_stiffness` (n,), k is `caution` times the slope's magnitude plus the extra. Law terms are evaluated at
        the end of the step of `loads.memory`; if that is infinite, as in a quasi-static motion.
        """
        extra = self._none if extra_stiffness is None else extra_stiffness
        plain_step = extra_stiffness is None and caution == 1.0 and _timed(loads)
        if self.laws is None or self.terms is None or (self._has_terms and not plain_step):
            self._drive_plainly(loads, damping, extra, caution)
        else:
            memory, step_s = self._still, self.model.opt.timestep
            if loads.memory is not None:
                memory, step_s = (loads.memory.previous, loads.memory.states.reshape(-1)), loads.memory.dt_s
            options = (step_s, damping, caution)
            drive(
                self.laws, self.terms, self.layout, self._views, self._inputs(loads), options, extra, memory
            )
        self._push(loads)

    def _inputs(self, loads: Loads) -> tuple[Array, float, float]:
        """Return values of the actuators, end moment, temperature."""
        if loads is not self._loads:
            self._loads, self._values = loads, self.statics.efforts.values(loads.actuation)
        temperature = 0.0 if loads.memory is None else float(loads.memory.temperature_c)
        return self._values, float(loads.moment_n_m), temperature

    def _drive_plainly(self, loads: Loads, damping: float, extra: Array, caution: float) -> None:
        """Apply the forces in Python: for laws or terms without a compiled form and terms in a quasi-static motion."""
        step_s, q, timed = self.model.opt.timestep, self.q, _timed(loads)
        if timed:
            q = q + step_s * self.rates
        effort = self.statics.efforts.evaluate(q, loads.actuation, loads.memory)
        slopes = np.abs(0.5 * (effort.dtau_du + effort.dtau_du.transpose(0, 2, 1)))
        slopes = (slopes * self._reach).sum(axis=2) / self._reach
        implicit = step_s * caution * (slopes + extra[:, None] / self._reach**2)
        force = effort.tau
        force[:, self.main] -= loads.moment_n_m
        if self.ball:
            inverse = right_jacobian_inverse(self._geometry.rotation_vectors(q))
            slide, basis = force[:, -1], self._geometry.basis
            torque = np.einsum("nji,nj->ni", inverse, self._geometry.rotation_vectors(force))
            force, held = np.empty(self._applied.shape), np.empty(self._applied.shape)
            self._with_slide(force, slide)[:, :3] = torque
            self._with_slide(held, implicit[:, -1])[:, :3] = implicit @ basis.T
            implicit = held
        force, implicit = force.reshape(self._applied.shape), implicit.reshape(self._damping.shape)
        self._applied[:] = force + implicit * self._qvel if timed else force
        self._damping[:] = damping + implicit

    def rested(self) -> TermMemory | None:
        """Return the memory of law terms in a virgin chain; None without terms."""
        return self.statics.efforts.terms.rested() if self._has_terms else None

    def remember(self, loads: Loads) -> Loads:
        """Return the loads after a step that ended at the present state, with the memory of law terms."""
        if loads.memory is None:
            return loads
        memory = loads.memory
        if self.laws is None or self.terms is None or not _timed(loads):
            return loads.after(self.statics.efforts.advance(self.q, loads.actuation, memory))
        past, states = memory.previous.copy(), memory.states.copy()
        given = (self._views[0], self._inputs(loads), memory.dt_s, (past, states.reshape(-1)))
        remember(self.laws, self.terms, self.layout, *given)
        return loads.after(replace(memory, previous=past, states=states))

    def _push(self, loads: Loads) -> None:
        """Apply forces of the loads to the bodies at their present positions."""
        data = self._data
        self.push_tip(loads)
        if not loads.forces and not loads.cords:
            return
        mujoco.mj_kinematics(self.model, data)
        mujoco.mj_comPos(self.model, data)
        bodies, none = slice(self.base, self.tip), np.zeros(3)
        pose = Pose(
            data.xpos[bodies], data.xmat[bodies].reshape(-1, 3, 3), NOT_NEEDED, NOT_NEEDED, NOT_NEEDED
        )
        for pull in self.statics.acting(pose, loads):
            body = self.base + pull.body
            mujoco.mj_applyFT(self.model, data, pull.force_n, none, pull.point_m, body, data.qfrc_applied)

    def push_tip(self, loads: Loads) -> None:
        """Apply the tip force to its body until the next call."""
        self._data.xfrc_applied[self.tip, :3] = loads.tip_force_n

    def markers(self) -> Array:
        """Return (n + 2, 3) base, joints and tip by MuJoCo's present kinematics."""
        return self._data.xpos[self.base : self.tip + 1].copy()


def _timed(loads: Loads) -> bool:
    """Return whether time passes for law terms."""
    return loads.memory is not None and math.isfinite(loads.memory.dt_s)
