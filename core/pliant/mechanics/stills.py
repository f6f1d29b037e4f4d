"""Shapes of a scene's state in the world frame, for pictures."""

from __future__ import annotations

from pliant.mechanics.kinematics import ChainGeometry
from pliant.records.scene import Scene, SceneState, SceneStill


def still(scene: Scene, state: SceneState, label: str = "") -> SceneStill:
    """Return all shapes at their poses in the state."""
    arms = []
    for number, (arm, q) in enumerate(zip(scene.arms, state.coordinates, strict=True)):
        moved = scene.base_motion(number, state.carriage_m, state.positions_m, state.rotations)
        pose = ChainGeometry.from_chain(arm.chain).forward(q).moved(*moved)
        bodies = zip(arm.chain.shapes, pose.rotations, pose.origins, strict=True)
        arms.append(tuple(s.placed(turn, origin) for shapes, turn, origin in bodies for s in shapes))
    objects = [
        tuple(shape.placed(turn, place) for shape in body.shapes)
        for body, turn, place in zip(scene.objects, state.rotations, state.positions_m, strict=True)
    ]
    objects += [obstacle.shapes for obstacle in scene.obstacles]
    return SceneStill(label, state.time_s, tuple(arms), tuple(objects), scene.floor_m)
