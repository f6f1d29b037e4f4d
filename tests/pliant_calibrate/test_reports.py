"""Tables of public reports: compression that counts positive, kgf/cm2, simple shear. The rubber has 400 kPa."""

from pathlib import Path

import numpy as np
import pytest
from tests.materials.test_named import PRESETS, built

from pliant.errors import UserError
from pliant.mechanics.homogeneous import incompressible_stress
from pliant_calibrate.checks import steepening
from pliant_calibrate.reading import BenchData, read_bench_data

MODULUS_PA = 400e3
PULLED, PRESSED = np.linspace(1.02, 1.6, 16), np.linspace(0.98, 0.6, 16)
SIZES = "gauge_length: 10 mm\nsection: 100 mm^2\n"


def stress_pa(stretch: np.ndarray) -> np.ndarray:
    return MODULUS_PA * (stretch - stretch**-2)


def read(folder: Path, head: str, *columns: np.ndarray, notes: str = "") -> BenchData:
    path = folder / "a.csv"
    path.write_text(
        "\n".join([head, *(",".join(f"{v:.12g}" for v in row) for row in zip(*columns, strict=True))])
    )
    if notes:
        path.with_suffix(".yaml").write_text(notes)
    return read_bench_data(path)


@pytest.mark.parametrize("unit", ["kgf/cm^2", "kgf/cm2", "kgf/cm²", "kg/cm2"])
def test_treloars_unit(tmp_path: Path, unit: str):
    """WelSimLLC/WelSim-Apps#17."""
    found = read(tmp_path, f"stretch,nominal stress [{unit}]", PULLED, stress_pa(PULLED) / 98066.5)
    assert found.y == pytest.approx(stress_pa(PULLED), rel=1e-9)


@pytest.mark.parametrize(
    ("head", "strain", "stress", "notes"),
    [
        ("Compressive extension (mm),Compressive load (N)", 10.0, 1e-4, SIZES),
        ("Compressive extension (mm),Load (N)", 10.0, -1e-4, SIZES),
        ("Compression strain [%],Compression stress [kPa]", 100.0, 1e-3, "rename: {Compression strain: strain, "
         "Compression stress: nominal_stress_pa}"),
    ],
)  # fmt: skip
def test_compression_that_is_called_so(tmp_path: Path, head: str, strain: float, stress: float, notes: str):
    """An Instron's compression test: mechfares.com, "From compression test to curve fitting", 26 May 2023."""
    found = read(tmp_path, head, strain * (1 - PRESSED), -stress * stress_pa(PRESSED), notes=notes)
    assert found.x == pytest.approx(PRESSED, rel=1e-9) and found.y == pytest.approx(
        stress_pa(PRESSED), rel=1e-9
    )
    assert any("taken as negative" in remark for remark in found.remarks)


def test_compression_that_is_negative_already(tmp_path: Path):
    head = "Compressive extension (mm),Compressive load (N)"
    found = read(tmp_path, head, 10 * (PRESSED - 1), 1e-4 * stress_pa(PRESSED), notes=SIZES)
    assert found.x == pytest.approx(PRESSED) and found.y == pytest.approx(stress_pa(PRESSED))
    assert not any("taken as negative" in remark for remark in found.remarks)


def test_compression_that_is_not_called_so_is_doubted(tmp_path: Path):
    """A law with three constants fits it within 0.3 % of its range, and its modulus is 461 kPa."""
    found = read(tmp_path, "strain,nominal_stress_pa", 1 - PRESSED, -stress_pa(PRESSED))
    assert any("If the rows are of compression" in remark for remark in found.remarks)


def test_a_pull_is_not_doubted(tmp_path: Path):
    assert not read(tmp_path, "stretch,nominal_stress_pa", PULLED, stress_pa(PULLED)).remarks


@pytest.mark.parametrize("name", PRESETS)
def test_no_named_rubber_is_doubted(name: str):
    law = built(name=name)
    assert not steepening(PULLED, incompressible_stress(law, PULLED))


@pytest.mark.parametrize(
    ("head", "notes"),
    [
        ("shear strain,shear stress [kPa]", ""),
        (
            "shear strain,shear stress [kPa]",
            "rename: {shear strain: strain, shear stress: nominal_stress_pa}",
        ),
    ],
)
def test_simple_shear_is_no_pull_of_a_wide_strip(tmp_path: Path, head: str, notes: str):
    """WelSimLLC/WelSim-Apps#135."""
    shear = np.linspace(0.05, 1.0, 16)
    with pytest.raises(UserError, match="simple shear is not fitted, and 'planar'"):
        read(tmp_path, head, shear, MODULUS_PA * shear, notes=notes)


def test_rows_of_simple_shear_come_in_one_line(tmp_path: Path):
    (tmp_path / "a.csv").write_text("test,strain,nominal_stress_pa\n" + "simple shear,0.1,4e4\n" * 30)
    with pytest.raises(UserError, match="simple shear is not fitted") as error:
        read_bench_data(tmp_path / "a.csv")
    assert str(error.value).count("\n") == 2
