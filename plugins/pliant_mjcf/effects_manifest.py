"""The effects of MuJoCo models as components; nothing heavy is imported here."""

from __future__ import annotations

from pliant.registry.component import Component

HERE = "pliant_mjcf"
JOINT, FORCE, DRIVE = "effects_joint", "effects_joint_force", "effects_drive"
TENDON, BODY, WORLD = "effects_tendon", "effects_body", "effects_world"

# kind, module, class, summary
EFFECTS = (
    ("stiffness", JOINT, "JointStiffness", "joints have an additional spring"),
    ("rest_angle", JOINT, "RestAngle", "springs of joints rest elsewhere"),
    ("viscous_damping", JOINT, "JointDamping", "joints have additional damping"),
    ("coulomb_friction", JOINT, "CoulombFriction", "joints have additional dry friction"),
    ("stribeck_friction", FORCE, "StribeckFriction", "dry friction of joints, larger at rest than at speed"),
    ("friction_hysteresis", FORCE, "JointHysteresis", "joints have springs that slip"),
    ("viscoelastic", FORCE, "JointRelaxation", "joints have springs that relax"),
    ("joint_play", DRIVE, "JointPlay", "position drives move joints through a play"),
    ("tendon_friction", TENDON, "TendonFriction", "tendons have additional dry friction"),
    ("tendon_stiffness", TENDON, "TendonStiffness", "tendons have an additional spring"),
    ("tendon_slack", TENDON, "TendonSlack", "position drives first take up the slack of tendons"),
    ("body_mass", BODY, "BodyMass", "bodies are heavier or lighter by a factor"),
    ("centre_of_mass", BODY, "CentreOfMass", "centres of mass are elsewhere"),
    ("body_inertia", BODY, "BodyInertia", "bodies have another rotational inertia"),
    ("payload", BODY, "Payload", "bodies carry a point mass"),
    ("gravity_scale", WORLD, "WorldGravityScale", "weights differ by a factor"),
    ("gravity_direction", WORLD, "GravityDirection", "gravity is tilted"),
    ("base_misalignment", WORLD, "WorldMisalignment", "the base is turned"),
    ("floor_friction", WORLD, "FloorFriction", "the floor's sliding friction differs by a factor"),
)


def effect_components() -> list[Component]:
    """Return the effects of MuJoCo models."""
    return [
        Component(
            interface="effect",
            kind=kind,
            config=f"{HERE}.{module}:{name}Config",
            implementation=f"{HERE}.{module}:{name}",
            summary=summary,
            requires=("mujoco",),
            install="pip install 'pliant[mujoco]'",
            models=("mjcf",),
        )
        for kind, module, name, summary in EFFECTS
    ]
