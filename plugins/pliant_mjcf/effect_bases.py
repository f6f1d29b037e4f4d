"""Base classes of effects of MuJoCo models; an effect of your own is a file of some ten lines.

`JointForce` adds a force at each chosen joint, as a function of its position and velocity; `JointMemory` one with
internal states; `GeneralForce` any generalised force, as a function of the `MjModel` and its state; `ModelEffect`
changes numbers of the compiled model:

    class Drag(JointForce):
        config: DragConfig

        def force(self, q, v):
            return -self.config.drag * abs(v) * v

Arrays have a row for each run. Forces are in N, of hinges in N·m, and act on top of those of the model.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import Any

import numpy as np

from pliant.interfaces.model import SystemEffect, SystemParts
from pliant.records.design import Array
from pliant_mjcf.changes import ModelChange, StateForce
from pliant_mjcf.elements import Joints, elements


class MjcfEffect(SystemEffect):
    """An effect of a MuJoCo model, at the elements that its pattern names."""

    models = ("mjcf",)

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other) and self.config == getattr(other, "config", None)

    def __hash__(self) -> int:
        return hash((type(self), self.config))

    def numbers(self, model: Any) -> list[int]:
        """Return the numbers of the chosen elements; raise `UserError` without any."""
        known = elements(model, self.place)
        return [known[name] for name in self.chosen(tuple(known))]

    def change(self, model: Any) -> None:
        """Change a compiled model in place; without an own change, check only that the pattern fits."""
        self.numbers(model)

    def write(self, spec: Any, model: Any) -> None:
        """Write the changed numbers of the compiled model into its specification, whose elements have its numbers.

        Raises:
            NotImplementedError: MJCF cannot say it.
        """
        raise NotImplementedError

    @property
    def is_neutral(self) -> bool:
        """Return whether every strength has its neutral value."""
        strengths = [one for one in self.config.fit_parameters() if one.role == "strength"]
        return bool(strengths) and all(getattr(self.config, one.name) == one.neutral for one in strengths)


class ModelEffect(MjcfEffect):
    """An effect that changes numbers of the compiled model: `change`, and `write` for the model as a file."""

    @abstractmethod
    def change(self, model: Any) -> None:
        """Change a compiled `mujoco.MjModel` in place."""

    def act(self, parts: SystemParts) -> SystemParts:
        """Return the parts with the change."""
        return parts.with_change(EffectChange(self))


@dataclass(frozen=True)
class EffectChange(ModelChange):
    """The change of numbers that an effect makes."""

    effect: MjcfEffect

    def change(self, model: Any) -> None:
        """Change a copy of the compiled model in place."""
        self.effect.change(model)

    def edit(self, spec: Any) -> None:
        """Make the same change in a specification, which is compiled for it."""
        model = spec.compile()
        self.effect.change(model)
        self.effect.write(spec, model)


@dataclass(frozen=True)
class EffectCheck(ModelChange):
    """The check that a neutral effect's pattern fits the model, of which nothing changes."""

    effect: MjcfEffect

    def change(self, model: Any) -> None:
        """Raise `UserError` if no element is chosen."""
        self.effect.numbers(model)

    def edit(self, spec: Any) -> None:
        """Change nothing."""


class JointMemory(MjcfEffect):
    """A force at each chosen joint that depends on its history; a neutral one costs nothing."""

    place = "joint"

    def begin(self, joints: Joints, q: Array, v: Array) -> Any:
        """Return the internal states at the beginning, for (r, n) positions and velocities of the chosen joints."""
        return ()

    @abstractmethod
    def advance(self, joints: Joints, state: Any, q: Array, v: Array, step_s: float) -> tuple[Array, Any]:
        """Return (r, n) the forces during the next step, and the internal states after it."""

    def act(self, parts: SystemParts) -> SystemParts:
        """Return the parts with the force."""
        return parts.with_change(EffectCheck(self) if self.is_neutral else EffectForce(self))


class JointForce(JointMemory):
    """A force at each chosen joint that depends on its position and velocity."""

    @abstractmethod
    def force(self, q: Array, v: Array) -> Array:
        """Return (r, n) the forces at (r, n) positions and velocities of the chosen joints."""

    def advance(self, joints: Joints, state: Any, q: Array, v: Array, step_s: float) -> tuple[Array, Any]:
        """Return the forces, and no state."""
        return self.force(q, v), state


@dataclass(frozen=True)
class EffectForce(StateForce):
    """The force of an effect at joints."""

    effect: JointMemory

    def start(self, model: Any, q: Array, v: Array) -> Any:
        """Return the joints and their internal states."""
        joints = Joints.of(model, self.effect.numbers(model))
        return joints, self.effect.begin(joints, q[:, joints.qpos], v[:, joints.dofs])

    def advance(self, model: Any, state: Any, q: Array, v: Array, step_s: float) -> tuple[Array, Any]:
        """Return (r, nv) the force during the next step, and the joints with their next states."""
        joints, inner = state
        found, inner = self.effect.advance(joints, inner, q[:, joints.qpos], v[:, joints.dofs], step_s)
        if found.shape == v.shape and joints.in_order:
            return found, (joints, inner)
        force = np.zeros_like(v)
        force[:, joints.dofs] = found
        return force, (joints, inner)


class GeneralForce(MjcfEffect):
    """A generalised force of the whole model that depends on its state."""

    place = "world"

    @abstractmethod
    def force(self, model: Any, q: Array, v: Array) -> Array:
        """Return (r, nv) the force at (r, nq) positions and (r, nv) velocities of a compiled `mujoco.MjModel`."""

    def act(self, parts: SystemParts) -> SystemParts:
        """Return the parts with the force."""
        return parts.with_change(EffectCheck(self) if self.is_neutral else WholeForce(self))


@dataclass(frozen=True)
class WholeForce(StateForce):
    """The force of an effect on the whole model."""

    effect: GeneralForce

    def start(self, model: Any, q: Array, v: Array) -> Any:
        """Return no state; raise `UserError` for a pattern that does not fit."""
        self.effect.numbers(model)
        return ()

    def advance(self, model: Any, state: Any, q: Array, v: Array, step_s: float) -> tuple[Array, Any]:
        """Return (r, nv) the force during the next step."""
        return self.effect.force(model, q, v), state
