"""MuJoCo's scenes as the correct ones, and engines that break one clause of the contract each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from tests.conformance.broken.physics import Engine, variants

from pliant.interfaces.physics import Capabilities
from pliant.interfaces.simulation import SceneSimulation
from pliant.records.design import Array
from pliant.records.scene import Scene, SceneState
from pliant_plugins.physics.mujoco.backend import Mujoco
from pliant_plugins.physics.mujoco.config import MujocoConfig


def _passing_on(name: str) -> Callable[..., Any]:
    return lambda self, *given: getattr(self.inner, name)(*given)


def _wrap(self: Any, scene: Scene) -> None:
    self.scene, self.inner = scene, Mujoco(MujocoConfig()).build_scene(scene)


METHODS = [*SceneSimulation.__abstractmethods__, "close"]
# A scene of MuJoCo, unchanged.
Wrapped: Any = type(
    "Wrapped",
    (SceneSimulation,),
    {"__module__": __name__, "__init__": _wrap, **{name: _passing_on(name) for name in METHODS}},
)


class Scenes(Engine):
    """The stand-in with scenes: `wrapper` is the class that it builds, from the scene that `placed` returns."""

    capabilities = Capabilities(("revolute",), dynamic=True)
    wrapper = Wrapped

    def build_scene(self, scene: Scene) -> SceneSimulation:
        return self.wrapper(self.placed(scene))  # type: ignore[no-any-return]

    def placed(self, scene: Scene) -> Scene:
        return scene


broken, simulated = variants.row_adder(Scenes), variants.row_adder(Scenes, "wrapper")


def placed(check: str, change: Any) -> None:
    """Add a row: the engine builds another scene."""
    broken(check, placed=lambda up, self, scene: change(scene))


def touching(check: str, change: Any) -> None:
    """Add a row: every contact is reported with changed fields."""
    simulated(check, contacts=lambda up, self: tuple(replace(c, **change(c)) for c in up()))


def _with_centres(up: Any, self: Any) -> SceneState:
    good: SceneState = up()
    arms = [r @ one.mass.com_m for r, one in zip(good.rotations, self.scene.objects, strict=True)]
    return replace(good, positions_m=good.positions_m + np.array(arms).reshape(-1, 3))


def _pushing_once(up: Any, self: Any, index: int, force_n: Array, moment_n_m: Array | None = None) -> None:
    up(index, force_n, moment_n_m)
    self.__dict__.setdefault("pushed", {})[index] = 0.0 * force_n


def _letting_go(up: Any, self: Any, duration_s: float) -> None:
    up(duration_s)
    for index, nothing in self.__dict__.get("pushed", {}).items():
        self.inner.push(index, nothing)


def _sinking(up: Any, self: Any) -> SceneState:
    good: SceneState = up()
    return replace(good, positions_m=good.positions_m + np.array([0.0, 0.0, -4.5e-4 * good.time_s]))


def _hastily(up: Any, self: Any, state: SceneState) -> None:
    up(state)
    self.inner.step(2e-3)


WORLD: list[SceneSimulation] = []


def _as_the_newest(up: Any, self: Any, scene: Scene) -> None:
    up(scene)
    WORLD[:] = [self.inner]


def _scaled_in_place(scene: Scene) -> Scene:
    scene.arms[0].chain.bodies[1].inertia_kg_m2[:] *= 2.0
    return scene


simulated("starts_where_the_scene_is", snapshot=_with_centres)
placed("objects_fall", lambda scene: replace(scene, gravity_m_s2=0.5 * scene.gravity_m_s2))
simulated("pushes_accelerate", push=_pushing_once, step=_letting_go)
touching("rests_on_the_floor", lambda c: {"normal_n": 2e-3 * c.normal_n})
placed("friction_is_the_product", lambda scene: replace(scene, floor_friction=1.0))
simulated(
    "arms_settle_in_equilibrium",
    apply=lambda up, self, inputs: up([replace(one, forces=(), cords=()) for one in inputs]),
)
placed("obstacles_hold_arms", lambda scene: replace(scene, obstacles=()))
simulated("carriage_moves_arms", carry=lambda up, self, v: up(0.99 * v))
touching("contacts_have_signs", lambda c: {"normal": -c.normal})
simulated("held_objects_do_not_creep", snapshot=_sinking)
simulated("restores_a_scene", restore=_hastily)
simulated(
    "scenes_report_extrapolation",
    outside_domain=lambda up, self: tuple(replace(o, module=(o.module - 1) % 3 + 1) for o in up()),
)
simulated(
    "scenes_are_independent",
    __init__=_as_the_newest,
    step=lambda up, self, duration_s: up(duration_s) if WORLD[0] is self.inner else None,
)
placed("leaves_the_scene_alone", _scaled_in_place)
