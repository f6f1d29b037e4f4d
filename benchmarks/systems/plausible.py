"""The largest strength of each kind that a laboratory would meet; a set that needs more is not made.

The numbers were written down after the 13 answers of the first runs, with the plugins' plausible ranges in view, and
before any answer to a set made with them, from what robots of these sizes show: servo and harmonic drives, Bowden
tendons, pneumatic supplies, encoders and cameras, and mistakes of mounting. A strength is in the unit of its equations:
relative to what the system does without the effect, or in physical units.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple


class Plausible(NamedTuple):
    """The largest plausible strength, its unit, and for what is beside a body the largest distance in m."""

    largest: float
    unit: str
    aside_m: float = float("inf")


COMMAND, READING = "of the largest command", "of the largest reading"
FORCE = "of the drive's usual force"
SPRING = "of the drive's usual force, at half the range"
DAMPING = "of the drive's usual force, at the usual speed"
SPAN, MASS = "of half the range", "of the body's mass"

PLAUSIBLE: Mapping[str, Plausible] = {
    "actuation_gain": Plausible(0.3, "of the stated gain"),
    "input_offset": Plausible(0.2, COMMAND),
    "dead_zone": Plausible(0.2, COMMAND),
    "supply_lag": Plausible(0.3, "s"),
    "dead_time": Plausible(0.15, "s"),
    "backlash": Plausible(0.15, COMMAND),
    "saturation": Plausible(0.4, COMMAND + ", cut off"),
    "leak": Plausible(1.0, "1/s"),
    "sensor_bias": Plausible(0.15, READING),
    "sensor_scale": Plausible(0.2, "of the stated scale"),
    "sensor_lag": Plausible(0.2, "s"),
    "sensor_delay": Plausible(0.15, "s"),
    "misaligned_frame": Plausible(0.2, "rad"),
    "stiffness": Plausible(1.5, SPRING),
    "rest_angle": Plausible(0.2, "rad"),
    "viscous_damping": Plausible(1.5, DAMPING),
    "coulomb_friction": Plausible(0.6, FORCE),
    "stribeck_friction": Plausible(0.6, FORCE),
    "friction_hysteresis": Plausible(0.6, FORCE),
    "viscoelastic": Plausible(1.5, SPRING),
    "joint_play": Plausible(0.15, SPAN),
    "tendon_friction": Plausible(0.5, FORCE),
    "tendon_stiffness": Plausible(1.5, SPRING),
    "tendon_slack": Plausible(0.3, SPAN),
    "body_mass": Plausible(0.5, MASS),
    "centre_of_mass": Plausible(0.5, "of the body's radius of gyration", 0.05),
    "body_inertia": Plausible(1.0, "of the body's inertia"),
    "payload": Plausible(0.5, MASS, 0.1),
    "gravity_scale": Plausible(0.2, "of gravity"),
    "gravity_direction": Plausible(0.15, "rad"),
    "base_misalignment": Plausible(0.15, "rad"),
    "torque_ripple": Plausible(0.6, FORCE),
    "joint_coupling": Plausible(0.6, FORCE),
    "moment_arm": Plausible(0.5, "of the drive's force"),
    "draught": Plausible(0.6, FORCE),
    "varying_payload": Plausible(0.5, MASS),
    "encoder_marks": Plausible(0.1, READING),
    "supply_sag": Plausible(0.4, "of the commands"),
}
