"""Wrong tables and studies give one message that states the mistake, its place and the remedy."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from calibration_tables import BarBench, config, stress, study, write

from pliant.config.study import Study
from pliant.errors import UserError
from pliant_calibrate.calibration import calibrate
from pliant_calibrate.reading import read_bench_data
from pliant_calibrate.result import Calibration

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
        (  # a strain column that begins above 0 is not a stretch offset by 5 %
            "stretch,nominal_stress_pa",
            (STRETCH[1:] - 1, STRESS[1:]),
            "line 2, column stretch: a stretch of 0.1 is a compression, .* write 'rename: {stretch: strain}'",
        ),
        (
            "strain_uniaxial,stress_uniaxial,strain_biaxial,stress_biaxial",
            (STRETCH, STRESS, STRETCH, STRESS),
            "2 tests beside each other .uniaxial, biaxial.*'rename: {strain_uniaxial: strain, stress_uniaxial: nom",
        ),
        (
            "True Strain,True Stress (MPa),Engineering Strain,Engineering Stress (MPa)",
            (STRETCH, STRESS, STRETCH, STRESS),
            '(?s)so.:\nrename:\n  "Engineering Strain": strain.*\n  "Engineering Stress .MPa.": nominal_stress_pa.*its',
        ),
        ("True Strain,strain,stress_pa", (STRETCH, STRETCH, STRESS), "name the column 'stress_pa' so"),
        (
            "stretch,nominal_stress_pa",
            (-STRETCH, STRESS),
            r"line 2: column stretch: a stretch of -1 is impossible",
        ),
        ("strain,nominal_stress_pa", (-STRETCH, STRESS), "a stretch of 0 is impossible"),
        ("stretch,nominal_stress_pa", (STRETCH, -STRESS), "opposite signs"),
        ("stretch,nominal_stress_pa", (STRETCH[:2], STRESS[:2]), "2 rows at 1 different stretch are too few"),
        ("stretch,nominal_stress_pa", (STRETCH, STRESS / 1e6), "require a shear modulus of 0.24 Pa"),
        (
            "stretch,nominal_stress_pa",
            (STRETCH, ["x"] * 9),
            "lines 2, 3.*: column nominal_stress_pa: 'x' is not a number",
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
    from pliant.interfaces.material import MaterialConfig
    from pliant_calibrate.fitting import chosen

    class Fixed(MaterialConfig):
        """A solid with no parameter except its density."""

        kind: str = "fixed"

    with pytest.raises(UserError, match="material 'fixed' has no constants to fit"):
        chosen(Fixed(), None)


def test_true_columns_are_not_confused_with_the_strip_at_rest(tmp_path: Path) -> None:
    path = table(tmp_path, "True Strain,True Stress (MPa)", np.log(STRETCH), STRESS * STRETCH / 1e6)
    path.with_suffix(".yaml").write_text("rename: {True Strain: strain, True Stress: nominal_stress_pa}")
    with pytest.raises(
        UserError, match=r"line 1: 'True Strain' of t.csv says that it is of the deformed strip"
    ):
        read_bench_data(path)


def test_a_stretch_in_a_strain_column_is_doubted(tmp_path: Path) -> None:
    found = fitted(table(tmp_path, "strain,nominal_stress_pa", STRETCH + 0.05, STRESS))
    assert any("zero at a strain of 1.05, as it is at a stretch of 1" in remark for remark in found.remarks)
    sound = fitted(table(tmp_path, "strain,nominal_stress_pa", STRETCH - 1, STRESS))
    assert not any("at a stretch of 1;" in remark for remark in sound.remarks)


@pytest.mark.parametrize(("softer", "told"), [(0.8, True), (0.99, False)])
def test_a_strip_that_is_let_back_softer_is_named(tmp_path: Path, softer: float, told: bool) -> None:
    stretch, values = np.append(STRETCH, STRETCH[-2::-1]), np.append(STRESS, softer * STRESS[-2::-1])
    found = fitted(table(tmp_path, "stretch,nominal_stress_pa", stretch, values))
    said = [remark for remark in found.remarks if "pulled and let back" in remark]
    assert bool(said) == told
    # the largest difference is a fifth of the stress one step below the largest
    assert not told or f"differs by up to {100 * 0.2 * STRESS[-2] / STRESS[-1]:.0f} %" in said[0]
