"""The structure of recordings in public repositories, each with this project's own numbers."""

from __future__ import annotations

import numpy as np
from tests.lab_files.lab_file import SAMPLES, LabFile, part, rows, text
from tests.lab_files.written import BAR, DEG, KPA, MBAR, MS, ONE, SLOW, P, T, named

SINCE_MIDNIGHT, EPOCH_S = 52_290_272, 1_609_060_336
X, Z = SLOW["tip_x_m"], SLOW["tip_z_m"]
CLOCK = "Timestamp (millisec since midnight today)"
VOLT = np.round(KPA / 7, 3)


def public() -> list[LabFile]:
    """Return files as loggers of student projects, of ROS and of a bench with a laser write them."""
    return [volts_bench(), rows_from_zero(), rosbag(), gauge_pressures()]


def volts_bench() -> LabFile:
    """Return a file with each quantity in volts and again in its unit, units after "in" in brackets."""
    head = "Time (in ms)\tLaser (in V)\tPressure (in V)\tLaser (in deg)\tPressure (in bar)"
    return LabFile(
        "units behind 'in' in brackets, volts beside them",
        {"a.tsv": text(head, *rows(MS, VOLT, VOLT, DEG, BAR, between="\t"))},
        named("a"),
        stated={"rename": {"Laser (in deg)": "angle_rad"}},
        refused=("nothing is measured", "Laser (in deg)"),
    )


def rows_from_zero() -> LabFile:
    """Return two header lines with a Python dict, chambers and joints counted from 0, a force plate, a second board."""
    names = "MPRpressure_0,MPRpressure_1,ForcePlate_0,RPRpressure_0,theta_0,theta_1"
    content = text(
        "logger started on:,2026-1-20_143126,,,,,",
        "ctrl_params:,{'n': 2, 'u_max': 1350.0, 'bookends': ('<', '>')},,,,,",
        f"{CLOCK},{names}",
        *rows(SINCE_MIDNIGHT + MS, MBAR, MBAR / 2, KPA, np.full(SAMPLES, 9.0), DEG, DEG / 2),
    )
    answer = {
        "time_s": SINCE_MIDNIGHT / 1000 + T,
        "pressure_1_pa": P,
        "pressure_2_pa": P / 2,
        "joint_1_angle_rad": ONE["slow"]["angle_rad"],
        "joint_2_angle_rad": ONE["slow"]["angle_rad"] / 2,
    }
    rename = {f"MPRpressure_{k}": f"pressure_{k + 1}_pa" for k in (0, 1)}
    rename |= {f"theta_{k}": f"joint_{k + 1}_angle_rad" for k in (0, 1)}
    units = {f"MPRpressure_{k}": "mbar" for k in (0, 1)} | {f"theta_{k}": "deg" for k in (0, 1)}
    return LabFile(
        "chambers and joints numbered from 0",
        {"a.csv": content},
        {"a": answer},
        stated={"rename": rename, "units": units},
        refused=(
            '"MPRpressure_0": pressure_1_pa',
            '"MPRpressure_1": pressure_2_pa',
            '"theta_1": joint_2_angle_rad',
        ),
    )


def rosbag() -> LabFile:
    """Return `rostopic echo -p`: a comment as header, nanoseconds since 1970, columns of attitude and position."""
    stamps = [f"{EPOCH_S}{ms:03}000000" if ms < 1000 else f"{EPOCH_S + ms // 1000}{ms % 1000:03}000000" for ms in
              MS.astype(int).tolist()]  # fmt: skip
    pose = ",".join(
        f"field.pose.{what}" for what in ("position.x", "position.z", "orientation.x", "orientation.w")
    )
    return LabFile(
        "rosbag to CSV",
        {
            "a.csv": text(
                f"%time,field.header.frame_id,field.pressure,{pose}",
                *rows(stamps, ["world"] * SAMPLES, KPA, X, Z, np.zeros(SAMPLES), np.ones(SAMPLES)),
            )
        },
        part("time_s", "pressure_pa", "tip_x_m", "tip_z_m", called=("a",))
        | {"a": {**part("pressure_pa", "tip_x_m", "tip_z_m")["slow"], "time_s": EPOCH_S + T}},
        stated={
            "rename": {
                "time": "time_s",
                "field.pressure": "pressure_pa",
                "field.pose.position.x": "tip_x_m",
                "field.pose.position.z": "tip_z_m",
            },
            "units": {
                "time": "ns",
                "field.pressure": "kPa",
                "field.pose.position.x": "m",
                "field.pose.position.z": "m",
            },
        },
        refused=('"time": ns  # by its size', '"field.pose.position.x": tip_x_m'),
    )


def gauge_pressures() -> LabFile:
    """Return a file of gauge pressures, whose unit says so."""
    return LabFile(
        "a pressure in barg",
        {"a.csv": text("t [s since start];p [barg];angle [deg]", *rows(T, BAR, DEG, between=";"))},
        named("a"),
    )
