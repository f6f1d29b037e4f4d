"""MuJoCo's scenes as the good ones, and engines that break one clause of theirs each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np

from broken.physics import Engine, variants
from pliant.interfaces.physics import Capabilities, SceneSimulation
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.rollout import Inputs, OutsideDomain
from pliant.records.scene import Contact, Scene, SceneState
from pliant_plugins.physics.mujoco.backend import Mujoco
from pliant_plugins.physics.mujoco.config import MujocoConfig


class Wrapped(SceneSimulation):
    """A scene of MuJoCo, unchanged."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.inner = Mujoco(MujocoConfig()).build_scene(scene)

    def apply(self, inputs: Sequence[Inputs]) -> None:
        self.inner.apply(inputs)

    def carry(self, velocity_m_s: Array) -> None:
        self.inner.carry(velocity_m_s)

    def push(self, index: int, force_n: Array, moment_n_m: Array | None = None) -> None:
        self.inner.push(index, force_n, moment_n_m)

    def step(self, duration_s: float) -> None:
        self.inner.step(duration_s)

    def snapshot(self) -> SceneState:
        return self.inner.snapshot()

    def restore(self, state: SceneState) -> None:
        self.inner.restore(state)

    def markers(self, arm: int) -> Array:
        return self.inner.markers(arm)

    def contacts(self) -> tuple[Contact, ...]:
        return self.inner.contacts()

    def outside_domain(self) -> tuple[OutsideDomain, ...]:
        return self.inner.outside_domain()

    def close(self) -> None:
        self.inner.close()


class Scenes(Engine):
    """The stand-in with scenes: `wrapper` is what it builds, from the scene that `placed` gives."""

    capabilities = Capabilities(("revolute",), dynamic=True, contacts=True)
    wrapper: type[Wrapped] = Wrapped

    def build_scene(self, scene: Scene) -> SceneSimulation:
        return self.wrapper(self.placed(scene))

    def placed(self, scene: Scene) -> Scene:
        return scene


scene_broken_by = variants.by_part(Scenes, "wrapper")


@scene_broken_by("starts_where_the_scene_is", "object's own frame")
class CentresOut(Wrapped):
    """Poses of centres of mass come out."""

    def snapshot(self) -> SceneState:
        good = super().snapshot()
        arms = [r @ one.mass.com_m for r, one in zip(good.rotations, self.scene.objects, strict=True)]
        return replace(good, positions_m=good.positions_m + np.array(arms).reshape(-1, 3))


@variants.by("objects_fall", "of falling")
class HalfGravity(Scenes):
    """Gravity in another unit of length."""

    def placed(self, scene: Scene) -> Scene:
        return replace(scene, gravity_m_s2=0.5 * scene.gravity_m_s2)


class Impulses(Wrapped):
    def __init__(self, scene: Scene) -> None:
        super().__init__(scene)
        self.pushed: dict[int, tuple] = {}

    def push(self, index: int, force_n: Array, moment_n_m: Array | None = None) -> None:
        self.inner.push(index, force_n, moment_n_m)
        self.pushed[index] = (0.0 * force_n, None)

    def step(self, duration_s: float) -> None:
        super().step(duration_s)
        for index, wrench in self.pushed.items():
            self.inner.push(index, *wrench)


@variants.by("pushes_accelerate", "velocities after pushes")
class PushesOnce(Scenes):
    """A push lasts for one step."""

    wrapper = Impulses


@scene_broken_by("rests_on_the_floor", "force \\(N\\) of the floor")
class Impulsive(Wrapped):
    """Impulses of a step instead of forces."""

    def contacts(self) -> tuple[Contact, ...]:
        return tuple(replace(c, normal_n=2e-3 * c.normal_n) for c in super().contacts())


@variants.by("friction_is_the_product", "as if the larger coefficient counted")
class LargerCounts(Scenes):
    """The larger coefficient of a pair."""

    def placed(self, scene: Scene) -> Scene:
        return replace(scene, floor_friction=1.0)


@scene_broken_by("arms_settle_in_equilibrium", "loads at points")
class WithoutPoints(Wrapped):
    """Scenes without loads at points."""

    def apply(self, inputs: Sequence[Inputs]) -> None:
        super().apply([replace(one, forces=(), cords=()) for one in inputs])


@scene_broken_by("carriage_moves_arms", "carriage_m after 0.2 s")
class Slow(Wrapped):
    """A motor that does not quite hold its speed."""

    def carry(self, velocity_m_s: Array) -> None:
        super().carry(0.99 * velocity_m_s)


@scene_broken_by("contacts_have_signs", "the normal points from first to second")
class Reversed(Wrapped):
    """Normals from second to first."""

    def contacts(self) -> tuple[Contact, ...]:
        return tuple(replace(c, normal=-c.normal) for c in super().contacts())


@scene_broken_by("held_objects_do_not_creep", "a held box creeps by 0.4")
class Creeping(Wrapped):
    """Friction as MuJoCo has it by default."""

    def snapshot(self) -> SceneState:
        good = super().snapshot()
        down = np.array([0.0, 0.0, -4.5e-4 * good.time_s])
        return replace(good, positions_m=good.positions_m + down)


@scene_broken_by("restores_a_scene", "state after restore")
class Hasty(Wrapped):
    """Takes a step to bring its caches up to date."""

    def restore(self, state: SceneState) -> None:
        super().restore(state)
        self.inner.step(2e-3)


@scene_broken_by("scenes_report_extrapolation", "reported were \\[1, 2, 3\\]")
class PerArm(Wrapped):
    """Joints are numbered from 1 in every arm."""

    def outside_domain(self) -> tuple[OutsideDomain, ...]:
        return tuple(replace(o, module=(o.module - 1) % 3 + 1) for o in super().outside_domain())


@scene_broken_by("scenes_are_independent", "beside another scene")
class OneWorld(Wrapped):
    """Only the newest scene moves."""

    world: ClassVar[list[SceneSimulation]] = []

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene)
        self.world[:] = [self.inner]

    def step(self, duration_s: float) -> None:
        if self.world[0] is self.inner:
            super().step(duration_s)


@variants.by("leaves_the_scene_alone", "changed in place")
class ScalesInPlace(Scenes):
    """Scales the caller's arrays."""

    def placed(self, scene: Scene) -> Scene:
        chain: ChainModel = scene.arms[0].chain
        chain.bodies[1].inertia_kg_m2[:] *= 2.0
        return scene
