"""Wrong tables and studies: one message that says what, where and what to do."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from calibration_tables import BarBench, config, stress, study, write

from pliant.calibration.calibration import calibrate
from pliant.calibration.reading import read_bench_data
from pliant.calibration.result import Calibration
from pliant.config.study import Study
from pliant.errors import UserError

STRETCH = np.linspace(1.0, 1.8, 9)
STRESS = stress(config("neo_hookean", shear_modulus=240e3), STRETCH)
NEO = study("neo_hookean", shear_modulus=2e5)


def table(folder: Path, header: str, *columns: Any) -> Path:
    return write(folder / "t.csv", header, *columns)


def fitted(path: Path, of: Study = NEO, **options: Any) -> Calibration:
    data = read_bench_data(path, options.get("test"))
    return calibrate(BarBench(), of, data, options.get("fit"))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("header", "columns", "says"),
    [
        (
            "stretch,stress_mpa",
            (STRETCH, STRESS),
            r"'nominal_stress_pa' is missing; name the column 'stress_mpa' so",
        ),
        ("stretch,true_stress_pa", (STRETCH, STRESS), "seems to be a true stress"),
        ("stretch,nominal_stres_pa", (STRETCH, STRESS), "the file has 'nominal_stres_pa'"),
        ("stretch,nominal_stress", (STRETCH, STRESS), "'nominal_stress_pa' is missing"),
        (
            "strech,nominal_stress_pa",
            (STRETCH, STRESS),
            "'stretch' or 'strain' is missing; the file has 'strech'",
        ),
        (
            "strain,nominal_stress_pa",
            (100 * (STRETCH - 1), STRESS),
            "line 5.*strain_percent|column strain_percent",
        ),
        ("stretch,nominal_stress_pa", (STRETCH - 1, STRESS), "if the column holds strains, name it strain"),
        (
            "stretch,nominal_stress_pa",
            (-STRETCH, STRESS),
            r"line 2: column stretch: a stretch of -1 is impossible",
        ),
        ("strain,nominal_stress_pa", (-STRETCH, STRESS), "a stretch of 0 is impossible"),
        ("stretch,nominal_stress_pa", (STRETCH, -STRESS), "opposite signs"),
        ("stretch,nominal_stress_pa", (STRETCH[:2], STRESS[:2]), "2 rows at 1 different stretch are too few"),
        ("stretch,nominal_stress_pa", (STRETCH, STRESS / 1e6), "ask for a shear modulus of 0.24 Pa"),
        (
            "stretch,nominal_stress_pa",
            (STRETCH, ["x"] * 9),
            "line 2: column nominal_stress_pa: 'x' is not a number",
        ),
        ("stretch,nominal_stress_pa", (STRETCH, [""] * 9), "no row is left to fit"),
        (
            "stretch,nominal_stress_pa,nominal_stress_mpa",
            (STRETCH, STRESS, STRESS),
            "both mean nominal_stress_pa",
        ),
        ("stretch,strain,nominal_stress_pa", (STRETCH, STRETCH, STRESS), "keep one of them"),
        ("stretch,nominal_stress_pa,test", (STRETCH, STRESS, ["uniaxal"] * 9), "did you mean 'uniaxial'"),
        (
            "stretch,nominal_stress_pa,sigma_nominal_stress_pa",
            (STRETCH, STRESS, [0] * 9),
            "above 0 in every row",
        ),
        ("time,force", (STRETCH, STRESS), "neither a tensile test"),
        ("pressure_pa,half_angle_rad", (STRETCH, STRESS), "twice the half-module angle"),
        ("pressure_pa,angle_rad", (-STRETCH, STRETCH), "is below 0"),
        ("pressure_pa,angle_rad", (STRETCH, 20 * STRETCH), "angle_deg"),
    ],
)
def test_wrong_tables_are_refused(header: str, columns: tuple[Any, ...], says: str, tmp_path: Path) -> None:
    with pytest.raises(UserError, match=says):
        fitted(table(tmp_path, header, *columns))


def test_an_empty_file_and_one_that_is_not_there(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text("# nothing\n")
    with pytest.raises(UserError, match="empty; it needs a header such as stretch,nominal_stress_pa"):
        read_bench_data(tmp_path / "t.csv")
    with pytest.raises(UserError, match="no such file"):
        read_bench_data(tmp_path / "none.csv")


def test_compression_alone_is_fine(tmp_path: Path) -> None:
    stretch = np.linspace(0.6, 1, 9)
    values = stress(config("neo_hookean", shear_modulus=240e3), stretch)
    found = fitted(table(tmp_path, "stretch,nominal_stress_pa", stretch, values))
    assert found.constants[0].value == pytest.approx(240e3, rel=1e-6)


def test_units_comments_blanks_and_other_columns(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    rows = [f"{100 * (a - 1):.6f},{b / 1e6:.9f},7" for a, b in zip(STRETCH, STRESS, strict=True)]
    path.write_text(
        "\n".join(["# a comment", "strain_percent,nominal_stress_mpa,humidity", *rows, "50,,7"]) + "\n"
    )
    found = fitted(path)
    assert found.constants[0].value == pytest.approx(240e3, rel=1e-4)
    assert any("1 row with a blank (line 12)" in remark for remark in found.remarks)
    assert any("1 column humidity" in remark for remark in found.remarks)


def test_rows_with_a_moment_are_no_free_curve(tmp_path: Path) -> None:
    moments = [0, 0, 0, 0, 0, 0, 0, 1e-3, 1e-3]
    data = read_bench_data(
        table(tmp_path, "pressure_pa,angle_rad,moment_n_m", 1e3 * STRETCH, 0.1 * STRETCH, moments)
    )
    assert len(data) == 7
    assert "2 rows with a moment (lines 9, 10)" in " ".join(data.remarks)


@pytest.mark.parametrize(
    ("of", "options", "says"),
    [
        (Study(name="x"), {}, "has no 'material' block"),
        (NEO, {"fit": ["density"]}, "no static test depends on the density"),
        (NEO, {"fit": ["c10"]}, "no such constant. It has poisson_ratio, shear_modulus"),
        (NEO, {"test": "uniaxal"}, "did you mean 'uniaxial'"),
        (NEO, {"test": "free"}, "'pressure_pa' or 'tendon_force_n' is missing"),
    ],
)
def test_wrong_requests_are_refused(of: Study, options: dict[str, Any], says: str, tmp_path: Path) -> None:
    with pytest.raises(UserError, match=says):
        fitted(table(tmp_path, "stretch,nominal_stress_pa", STRETCH, STRESS), of, **options)


def test_a_recording_in_motion_is_no_free_curve(tmp_path: Path) -> None:
    share = np.sin(np.linspace(0, np.pi, 41)) ** 2
    late = np.interp(np.arange(41) - 4, np.arange(41), share)
    time, held = 0.1 * np.arange(41), np.repeat([0, 1, 0.5, 0.2], 11)[:41]
    creep = held + 0.3 * (np.arange(41) % 11)
    for x, y, word in (
        (share, late, "between rise and fall of"),
        (held, creep, "while pressure_pa stands still"),
    ):
        with pytest.raises(UserError, match=f"in motion .*time_s.*{word}"):
            read_bench_data(table(tmp_path, "time_s,pressure_pa,angle_rad", time, 1e4 * x, y))
    data = read_bench_data(table(tmp_path, "time_s,pressure_pa,angle_rad", time, 1e4 * share, 0.5 * share))
    assert "taken as states at rest" in " ".join(data.remarks)


def test_bench_data_take_notes_and_print_lines_to_paste(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    rows = "\n".join(f"{a:.6f};{b:.3f}".replace(".", ",") for a, b in zip(STRETCH, STRESS / 1e3, strict=True))
    path.write_text(f"Streckung;sig [kPa]\n{rows}\n")
    with pytest.raises(UserError, match="Write into t.yaml") as caught:
        read_bench_data(path)
    path.with_suffix(".yaml").write_text(str(caught.value).split("meant so):\n")[1])
    np.testing.assert_allclose(read_bench_data(path).y, STRESS, rtol=1e-5)


def test_a_free_curve_needs_a_module(tmp_path: Path) -> None:
    path = table(tmp_path, "pressure_pa,angle_rad", 1e3 * STRETCH, 0.1 * STRETCH)
    with pytest.raises(UserError, match="has no 'family' block; a calibration on a free curve needs one"):
        fitted(path)


def test_a_material_without_constants_is_said() -> None:
    from pliant.calibration.fitting import chosen
    from pliant.interfaces.material import MaterialConfig

    class Fixed(MaterialConfig):
        """A solid with nothing but a density."""

        kind: str = "fixed"

    with pytest.raises(UserError, match="material 'fixed' has no constants to fit"):
        chosen(Fixed(), None)
