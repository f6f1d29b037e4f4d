"""Columns are proposed by name, unit and content; a missing unit is proposed by the range of the numbers."""

from pathlib import Path

import numpy as np
import pytest

from pliant.errors import UserError
from pliant.measurements.files import read_measurements
from pliant.measurements.plausible import epoch_unit


def asked(tmp_path: Path, text: str) -> str:
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(UserError) as error:
        read_measurements(tmp_path / "a.csv")
    return str(error.value)


def test_a_position_unit_follows_from_the_range_wherever_the_origin_is(tmp_path: Path):
    rows = "".join(f"{k / 10},{k % 5},{0.380 + 0.01 * (k % 5)},{0.79 - 0.005 * (k % 5)}\n" for k in range(20))
    block = asked(tmp_path, "time_s,Druck_seg,mocap_x,mocap_z\n" + rows)
    assert '"mocap_x": tip_x_m' in block and '"mocap_x": m  # by its range' in block  # 4 cm, not 0.4 mm
    assert '"mocap_z": m  # by its range' in block


def test_an_ambiguous_size_says_so(tmp_path: Path):
    rows = "".join(f"{k / 10},{k % 5},{0.3 * (k % 5)}\n" for k in range(20))
    block = asked(tmp_path, "time_s,pressure_kpa,winkel\n" + rows)  # 1.2: radians, or few degrees
    assert '"winkel": angle_rad' in block and '"winkel": rad  # by its largest value' in block


@pytest.mark.parametrize("name", ["Operator", "No", "Humidity [%]", "Load (N)", "Weg_1 (mm)", "Theoretical"])
def test_what_nothing_speaks_for_is_not_proposed(tmp_path: Path, name: str):
    cells = ["ab"] * 20 if name == "Operator" else list(range(20))
    rows = "".join(f"{k / 10},{cell},{2 * (k % 9)}\n" for k, cell in enumerate(cells))
    message = asked(tmp_path, f"time_s,{name},angle_deg\n{rows}")
    assert f'"{name}"' not in message or name.startswith("Weg")


def test_the_only_one_among_several_chambers_is_reported(tmp_path: Path):
    (tmp_path / "a.csv").write_text("time_s,seg_1,seg_2,seg_3,angle_deg\n0,0,0,0,0\n1,9,4,2,5\n2,9,4,2,5\n")
    (tmp_path / "a.yaml").write_text("{rename: {seg_1: pressure_pa}, units: {seg_1: kPa}}")
    remarks = "\n".join(read_measurements(tmp_path / "a.csv").remarks)
    assert "seg_1 is read as the only pressure, and seg_2, seg_3 are not" in remarks
    assert "did you mean pressure" not in remarks  # an assigned column is proposed for no other quantity


@pytest.mark.parametrize(
    ("times", "unit"),
    [
        ((1.7e9, 1.7e9 + 1), "s"),
        ((1.7e12, 1.7e12 + 1e3), "ms"),
        ((1.7e18, 1.7e18 + 1e9), "ns"),
        ((0.0, 1e3), ""),
    ],
)
def test_a_clock_since_1970_says_its_unit_by_its_size(times: tuple[float, float], unit: str):
    assert epoch_unit(np.array(times)) == unit


def test_neither_an_attitude_is_a_position_nor_a_plate_a_tendon(tmp_path: Path):
    rows = "".join(f"{k},{k % 5},{k % 3},{0.1 * (k % 4)},{k % 2}\n" for k in range(20))
    block = asked(
        tmp_path, "time_s,druck_seg [kPa],ForcePlate_0 [N],pose.position.x,pose.orientation.x\n" + rows
    )
    assert '"pose.position.x": tip_x_m' in block
    assert (
        "orientation" not in block.partition("Write into")[2]
        and "tendon_force" not in block.partition("Write into")[2]
    )


@pytest.mark.parametrize(
    "header",
    [
        "t1 [s],p1 [kPa],angle1 [deg],t2 [s],p2 [kPa],angle2 [deg]",
        "Time 1 (s),Pressure 1 (kPa),Angle 1 (deg),Time 2 (s),Pressure 2 (kPa),Angle 2 (deg)",
        "time [s],pressure [kPa],angle [deg],time.1 [s],pressure.1 [kPa],angle.1 [deg]",  # names by pandas
        "Sample 1,,,Sample 2,,\ntime [s],pressure [kPa],angle [deg],time [s],pressure [kPa],angle [deg]",
    ],
)
def test_runs_beside_each_other_are_no_chambers(tmp_path: Path, header: str):
    """Two clocks mean two recordings: their pressures and angles are not those of two chambers and joints."""
    rows = "".join(f"{k / 10},{k % 5},{k % 3},{k / 10},{k % 4},{k % 3}\n" for k in range(12))
    message = asked(tmp_path, f"{header}\n{rows}")
    assert "clocks of 2 runs that stand beside each other" in message and "rename:" not in message
