"""Where the effects of MuJoCo models act, by kind."""

from __future__ import annotations

from collections.abc import Collection, Mapping

JOINT, TENDON, BODY, WORLD = "joint", "tendon", "body", "world"
GRAVITY, FLOOR = "gravity", "floor"  # what effects in the world need

PLACE_OF_KIND: Mapping[str, str] = {
    "stiffness": JOINT,
    "rest_angle": JOINT,
    "viscous_damping": JOINT,
    "coulomb_friction": JOINT,
    "stribeck_friction": JOINT,
    "friction_hysteresis": JOINT,
    "viscoelastic": JOINT,
    "joint_play": JOINT,
    "tendon_friction": TENDON,
    "tendon_slack": TENDON,
    "tendon_stiffness": TENDON,
    "body_mass": BODY,
    "centre_of_mass": BODY,
    "body_inertia": BODY,
    "payload": BODY,
    "gravity_direction": WORLD,
    "gravity_scale": WORLD,
    "base_misalignment": WORLD,
    "floor_friction": WORLD,
}
# What kinds in the world need; others need gravity.
NEEDED: Mapping[str, str] = {"floor_friction": FLOOR}


def has_place(kind: str, attachments: Mapping[str, Collection[str]], world: Collection[str]) -> bool:
    """Return whether a model has a place for an effect; true for kinds of any model.

    Args:
        kind: of the effect.
        attachments: names of the model's places by kind of place.
        world: what its world has, of `GRAVITY` and `FLOOR`.
    """
    place = PLACE_OF_KIND.get(kind)
    if place is None:
        return True
    if place == WORLD:
        return NEEDED.get(kind, GRAVITY) in world
    return bool(attachments.get(place))
