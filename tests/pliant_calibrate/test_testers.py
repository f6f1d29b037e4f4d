"""Exports of tensile testers: the strip's sizes, stated or asked for, give stress and stretch."""

from pathlib import Path

import numpy as np
import pytest

from pliant.errors import UserError
from pliant_calibrate.reading import BenchData, read_bench_data

MODULUS_PA, GAUGE_MM, SECTION_MM2 = 100e3, 25.0, 12.0
STRETCH = np.linspace(1.0, 2.0, 11)
STRESS_PA = MODULUS_PA * (STRETCH - STRETCH**-2)  # neo-Hookean, incompressible, uniaxial
LOAD_N = STRESS_PA * SECTION_MM2 * 1e-6
EXTENSION_MM = (STRETCH - 1) * GAUGE_MM
SIZES = f"gauge_length: {GAUGE_MM} mm\nsection: {SECTION_MM2} mm^2\n"


def rows(*columns: np.ndarray, between: str = ",") -> str:
    return (
        "\n".join(between.join(f"{value:.9f}" for value in row) for row in zip(*columns, strict=True)) + "\n"
    )


BLUEHILL = '"Specimen label","A1"\n"Time","Extension","Load"\n"(s)","(mm)","(N)"\n'
EXPORTS = {
    "Instron Bluehill": BLUEHILL + rows(STRETCH, EXTENSION_MM, LOAD_N),
    "Zwick testXpert": "Prüfer;M. Müller;\nVorkraft;0,1;N\nPrüfzeit;Standardweg;Standardkraft\ns;mm;N\n"
    + rows(STRETCH, EXTENSION_MM, LOAD_N, between=";").replace(".", ","),
    "MTS, kN": "Axial Displacement\tAxial Force\tRunning Time\nmm\tkN\tSec\n"
    + rows(EXTENSION_MM, LOAD_N / 1000, STRETCH, between="\t"),
    "blank columns": "t (s), Load (N), Stress (kPa), Strain (mm), Travel (mm), No\n"
    + "".join(
        f"{k}, {f:.9f}, N/A, , {w:.9f}, 1\n"
        for k, (f, w) in enumerate(zip(LOAD_N, EXTENSION_MM, strict=True))
    ),
}


def read(tmp_path: Path, text: str, notes: str = "") -> BenchData:
    path = tmp_path / "strip.csv"
    path.write_text(text)
    path.with_suffix(".yaml").write_text(notes) if notes else path.with_suffix(".yaml").unlink(
        missing_ok=True
    )
    return read_bench_data(path)


@pytest.mark.parametrize("text", EXPORTS.values(), ids=EXPORTS)
def test_sizes_are_asked_for_and_make_stress_and_stretch(tmp_path: Path, text: str):
    with pytest.raises(UserError, match="tester's export.*gauge length and area of its section") as asked:
        read(tmp_path, text)
    block = str(asked.value).partition("with your numbers:\n")[2]
    with pytest.raises(UserError, match="tester's export"):
        read(tmp_path, text, block)  # pasted unchanged: no size is invented
    found = read(tmp_path, text, SIZES)
    assert found.kind == "tensile"
    np.testing.assert_allclose(found.x, STRETCH, atol=1e-9)
    np.testing.assert_allclose(found.y, STRESS_PA, rtol=1e-4, atol=1e-3)
    assert any("stretch is 1 + extension over 25 mm" in remark for remark in found.remarks)


def test_only_what_lacks_is_asked_for(tmp_path: Path):
    text = "Tensile strain (%),Load (N)\n" + rows(100 * (STRETCH - 1), LOAD_N)
    with pytest.raises(UserError, match=r"'Load \(N\)': a tester's export.*the area of its section") as asked:
        read(tmp_path, text, "rename: {Tensile strain (%): strain}\n")
    assert "gauge_length" not in str(asked.value)
    found = read(tmp_path, text, f"rename: {{Tensile strain (%): strain}}\nsection: {SECTION_MM2} mm^2\n")
    np.testing.assert_allclose(found.x, STRETCH, atol=1e-9)
    np.testing.assert_allclose(found.y, STRESS_PA, rtol=1e-4, atol=1e-3)


def test_two_loads_are_asked_about(tmp_path: Path):
    text = "Extension (mm),Load (N),Load 2 (N)\n" + rows(EXTENSION_MM, LOAD_N, LOAD_N)
    with pytest.raises(UserError, match=r"'Load \(N\)' and 'Load 2 \(N\)' may both be the load"):
        read(tmp_path, text, SIZES)


def test_a_strain_with_a_length_unit_names_its_column(tmp_path: Path):
    with pytest.raises(UserError, match=r"strip.csv: column 'Strain \(mm\)': the unit 'mm' is a length"):
        read(tmp_path, "Strain (mm),nominal_stress_pa\n" + rows(EXTENSION_MM, STRESS_PA))
