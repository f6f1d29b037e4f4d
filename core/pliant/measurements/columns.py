"""Columns of a measurement file: which names are known, in which unit, and what each is for."""

from __future__ import annotations

from pliant.errors import UserError, closest
from pliant.tabular.schema import Known, Schema

# The measurement CSV of docs/measurement_files.md.
KNOWN = (
    Known(r"run", "", "", "text"),
    Known(r"specimen", "", "", "text"),
    Known(r"time", "_s", "s", "time"),
    Known(r"pressure(_[1-9]\d*)?", "_pa", "Pa", "input"),
    Known(r"tendon_force(_[1-9]\d*)?", "_n", "N", "input"),
    Known(r"tendon_travel", "_m", "m", "output"),  # an input where the chain says so
    Known(r"moment", "_n_m", "N*m", "condition"),
    Known(r"tip_force_[xyz]", "_n", "N", "condition"),
    Known(r"payload", "_kg", "kg", "condition"),
    Known(r"valve_open", "", "", "condition"),  # 1: connected to the supply, 0: closed off
    Known(r"temperature", "_c", "degC", "condition"),
    Known(r"base_(roll|pitch|yaw)", "_rad", "rad", "condition"),
    Known(r"cycle", "", "", "cycle"),
    Known(r"angle", "_rad", "rad", "output"),
    Known(r"joint_[1-9]\d*_angle", "_rad", "rad", "output"),
    Known(r"tip_[xyz]", "_m", "m", "output"),
    Known(r"marker_[1-9]\d*_[xyz]", "_m", "m", "output"),
    Known(r"elongation", "_strain", "dimensionless", "output"),
    Known(r"successes", "", "", "count"),
    Known(r"trials", "", "", "count"),
)
# Names to suggest from: one of each family.
EXAMPLES = (
    *("run", "specimen", "time_s", "pressure_pa", "pressure_1_pa", "tendon_force_n", "tendon_travel_m"),
    *(
        "moment_n_m",
        "tip_force_x_n",
        "tip_force_y_n",
        "tip_force_z_n",
        "payload_kg",
        "temperature_c",
        "valve_open",
    ),
    *("base_roll_rad", "base_pitch_rad", "base_yaw_rad", "cycle", "angle_rad", "joint_1_angle_rad"),
    *("tip_x_m", "tip_y_m", "tip_z_m", "marker_1_x_m", "marker_1_y_m", "marker_1_z_m"),
    *("elongation_strain", "successes", "trials", "sigma_angle_rad"),
)


MEASUREMENT = Schema(KNOWN, "run,time_s,pressure_pa,angle_rad")


def unit_of(name: str) -> str:
    """SI unit of a column or output: "rad" for `angle_rad`, "" for texts and counts.

    Raises `UserError` for a name that is not in docs/measurement_files.md.
    """
    known = MEASUREMENT.find(name.removeprefix("sigma_"))
    if known is None:
        raise UserError(f"'{name}' is not a column of a measurement{closest(name, EXAMPLES)}")
    return known.unit


def is_output(name: str) -> bool:
    known = MEASUREMENT.find(name)
    return known is not None and known.role == "output"
