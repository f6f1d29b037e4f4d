"""Tables as solvers and spreadsheets write them, the YAML beside them, and one sentence for each mistake."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pliant.errors import UserError
from pliant.tabular.fem_columns import table_digest
from pliant.tabular.fem_reading import read_module_table, read_table

STATES = [(p, u, 1e-6 * p - 0.03 * u) for p in (0.0, 5e3, 1e4) for u in (0.0, 0.1, 0.2)]
PLAIN = "pressure_pa,angle_rad,moment_n_m\n" + "\n".join(f"{p},{u},{m}" for p, u, m in STATES)


def table(folder: Path, text: str, notes: str = "", name: str = "fem.csv") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    if notes:
        path.with_suffix(".yaml").write_text(notes, encoding="utf-8")
    return path


def same(path: Path) -> None:
    data = read_table(path)
    p, u, m = np.array(STATES).T
    np.testing.assert_allclose(data.actuation, p, rtol=1e-12)
    np.testing.assert_allclose(data.angle_rad, u, rtol=1e-12)
    np.testing.assert_allclose(data.moment_n_m, m, rtol=1e-12, atol=1e-18)


def in_solver_units(separator: str = ",", decimal: str = ".") -> list[str]:
    """kPa, half angles in degrees, moments in N·mm that help the actuation."""
    rows = [(p / 1e3, np.degrees(u) / 2, -1e3 * m) for p, u, m in STATES]
    return [separator.join(repr(float(v)).replace(".", decimal) for v in row) for row in rows]


NOTES = """\
rename: {"p (kPa)": pressure_pa, theta: angle_rad, "M (N*mm)": moment_n_m}
angle: half_module
moment: sign reversed
"""


@pytest.mark.parametrize(
    "head",
    [
        "% Model: bellow.mph\n% Version: COMSOL 6.2\n% p (kPa),theta (deg),M (N*mm)\n",
        "% Model: bellow.mph\np (kPa),theta [deg],M (N*mm)\n",
        "** Abaqus\n** History\np (kPa),theta [deg],M (N*mm)\n",
        "# bench\n\np (kPa),theta (deg),M (N*mm)\n",
    ],
)
def test_headers_of_solvers_are_read_with_their_units(tmp_path: Path, head: str) -> None:
    same(table(tmp_path, head + "\n".join(in_solver_units()), NOTES))


@pytest.mark.parametrize(("separator", "decimal"), [(";", ","), (";", "."), ("\t", "."), ("\t", ",")])
def test_spreadsheets_with_semicolons_tabs_and_decimal_commas(tmp_path: Path, separator, decimal) -> None:
    head = separator.join(["p (kPa)", "theta (deg)", "M (N*mm)"])
    text = "\n".join([head, *in_solver_units(separator, decimal)])
    same(table(tmp_path, text, NOTES, name="fem.txt"))


def test_units_of_the_notes_convert_plain_names(tmp_path: Path) -> None:
    rows = [f"{p / 1e3},{np.degrees(u)},{1e3 * m}" for p, u, m in STATES]
    text = "pressure_pa,angle_rad,moment_n_m\n" + "\n".join(rows)
    same(table(tmp_path, text, "units: {pressure_pa: kPa, angle_rad: deg, moment_n_m: N*mm}"))


def test_a_table_without_notes_keeps_its_bits_and_its_key(tmp_path: Path) -> None:
    path = table(tmp_path, PLAIN)
    assert read_table(path).moment_n_m.tolist() == [m for _, _, m in STATES]
    alone = table_digest(path)
    study = path.with_suffix(".yaml")
    study.write_text("pliant: 1\nname: a study\n")
    assert table_digest(path) == alone
    study.write_text("moment: sign reversed\n")
    assert table_digest(path) != alone
    np.testing.assert_array_equal(read_table(path).moment_n_m, [-m for _, _, m in STATES])


def test_a_missing_mapping_is_answered_with_lines_that_work(tmp_path: Path) -> None:
    head = "p (kPa),half_angle (deg),M (N*mm)\n"
    rows = [f"{p / 1e3},{np.degrees(u) / 2},{1e3 * m}" for p, u, m in STATES]
    path = table(tmp_path, head + "\n".join(rows))
    with pytest.raises(UserError, match="column 'pressure_pa' or 'tendon_force_n' is missing") as caught:
        read_table(path)
    lines = str(caught.value).split("meant so):\n")[1]
    path.with_suffix(".yaml").write_text(lines)
    same(path)


@pytest.mark.parametrize(
    ("notes", "sentence"),
    [
        ("rename: {theta: angle_rad}", "'rename' has 'theta', which is not a column of fem.csv"),
        ("units: {presure_pa: kPa}", "'units' has 'presure_pa'.*did you mean 'pressure_pa'"),
        (
            "units: {pressure_pa: N}",
            "fem.yaml: 'units' of 'pressure_pa', which is taken for pressure_pa: .*a pressure",
        ),
        ("angle: half", "angle"),
    ],
)
def test_notes_that_cannot_be_meant(tmp_path: Path, notes: str, sentence: str) -> None:
    with pytest.raises(UserError, match=sentence):
        read_table(table(tmp_path, PLAIN, notes))


def test_rows_beyond_a_stop_are_left_out(tmp_path: Path) -> None:
    path = table(tmp_path, PLAIN, "between: {angle_rad: [0.05, 0.3]}")
    assert read_table(path).angle_rad.tolist() == [u for _, u, _ in STATES if u >= 0.05]
    path.with_suffix(".yaml").write_text("between: {angle_rad: [3, 4]}")
    with pytest.raises(UserError, match="'between' leaves no row of fem.csv"):
        read_table(path)
    path.with_suffix(".yaml").write_text("between: {angel_rad: [3, 4]}")
    with pytest.raises(UserError, match="'between' has 'angel_rad'.*did you mean 'angle_rad'"):
        read_table(path)


def with_pressures(factor: float) -> str:
    return "pressure_pa,angle_rad,moment_n_m\n" + "\n".join(f"{factor * p},{u},{m}" for p, u, m in STATES)


@pytest.mark.parametrize(("factor", "unit"), [(1e-3, "kPa"), (1e-6, "MPa")])
def test_pressures_in_another_unit_are_noticed(tmp_path: Path, factor: float, unit: str) -> None:
    path = table(tmp_path, with_pressures(factor))
    with pytest.raises(UserError, match=rf"units: \{{pressure_pa: {unit}\}}"):
        read_table(path)
    path.with_suffix(".yaml").write_text(f"units: {{pressure_pa: {unit}}}")
    same(path)
    path.with_suffix(".yaml").write_text("units: {pressure_pa: Pa}")
    assert read_table(path).actuation.max() == pytest.approx(factor * 1e4)


def test_states_that_contradict_each_other_are_named_by_their_lines(tmp_path: Path) -> None:
    path = table(tmp_path, PLAIN + "\n0.0,0.1,0.02\n")
    with pytest.raises(
        UserError, match="lines 3 and 11 contradict each other: at pressure_pa = 0 and angle_rad = 0.1"
    ):
        read_table(path)


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (b"%PDF-1.7\n%\xe2\xe3", "it is a PDF"),
        (b"PK\x03\x04rest", "it is a spreadsheet or an archive"),
        (b"", "the table is empty"),
        (b"1,2,3\n4,5,6\n", "line 1: the first row holds numbers"),
        (b"pressure_pa;angle_rad;moment_n_m\n1.000,5;0,1;2\n", "line 2: '1.000,5' may be read in two ways"),
        (
            b"pressure_pa,angle_rad,moment_n_m\n1,20,2\n",
            "is the column in degrees\\? Then write 'units: {angle_rad: deg}'",
        ),
    ],
)
def test_files_that_are_no_table_of_states(tmp_path: Path, content: bytes, sentence: str) -> None:
    path = tmp_path / "fem.csv"
    path.write_bytes(content)
    with pytest.raises(UserError, match=sentence):
        read_table(path)


def sloped(by_p: float = 1e-6, by_u: float = -0.03) -> list[tuple[float, ...]]:
    return [(*state, by_p, by_u) for state in STATES]


def sloped_text(rows: list[tuple[float, ...]]) -> str:
    head = "pressure_pa,angle_rad,moment_n_m,dmoment_dp,dmoment_du\n"
    return head + "\n".join(",".join(map(repr, row)) for row in rows)


def test_slopes_are_in_the_units_and_signs_of_their_columns(tmp_path: Path) -> None:
    rows = [(p / 1e3, np.degrees(u) / 2, -1e3 * m) for p, u, m in STATES]
    slopes = (-1e3 * 1e-6 * 1e3, 1e3 * 0.03 * 2 * np.pi / 180)
    notes = (
        "units: {pressure_pa: kPa, angle_rad: deg, moment_n_m: N*mm}\n"
        "angle: half_module\nmoment: sign reversed\n"
    )
    path = table(tmp_path, sloped_text([tuple(map(float, (*row, *slopes))) for row in rows]), notes)
    same(path)
    np.testing.assert_allclose(read_table(path).dmoment_dp, 1e-6)
    np.testing.assert_allclose(read_table(path).dmoment_du, -0.03)


@pytest.mark.parametrize(
    ("slopes", "column"),
    [
        ({"by_u": 0.03}, "dmoment_du"),
        ({"by_u": -0.06}, "dmoment_du"),
        ({"by_p": 1e-3}, "dmoment_dp"),
        ({"by_p": -1e-6}, "dmoment_dp"),
    ],
)
def test_slopes_that_contradict_the_efforts_are_refused(
    tmp_path: Path, slopes: dict[str, float], column: str
) -> None:
    same(table(tmp_path, sloped_text(sloped())))
    with pytest.raises(UserError, match=f"column {column} contradicts moment_n_m: from line"):
        read_table(table(tmp_path, sloped_text(sloped(**slopes))))


def test_notes_hold_for_columns_of_every_axis(tmp_path: Path) -> None:
    head = "pressure_pa,axis,angle_rad,moment_n_m,angle_x_rad,angle_y_rad,moment_x_n_m,moment_y_n_m,dmoment_x_du_y\n"
    notes = "units: {angle_y_rad: deg, moment_x_n_m: N*mm}\nmoment: sign reversed\n"
    data = read_module_table(table(tmp_path, head + "0,all,0,0,0.1,180,5,6,7\n", notes))
    assert data.deformation[0] == pytest.approx([0.1, np.pi])
    assert data.tau[0] == pytest.approx((-5e-3, -6))
    assert data.dtau_du[0, 0, 1] == pytest.approx(-7e-3 * 180 / np.pi)


@pytest.mark.parametrize(
    ("notes", "sentence"),
    [
        ("units: {wall_mm: mm}\n", "fem.yaml: 'units' has 'wall_mm', which is read as it stands. Units are"),
        ("units: {dmoment_du: N*mm}\n", "a slope is in the units of its columns"),
        (
            "units: {pressure_pa: kPaa}\n",
            "fem.yaml: 'units' of 'pressure_pa', which is taken for pressure_pa",
        ),
    ],
)
def test_units_that_cannot_be_heeded_are_refused(tmp_path: Path, notes: str, sentence: str) -> None:
    text = sloped_text(sloped()).replace("\n", ",1.5\n") + ",1.5"
    text = text.replace("dmoment_du,1.5", "dmoment_du,wall_mm", 1)
    with pytest.raises(UserError, match=sentence):
        read_table(table(tmp_path, text, notes))


def test_actuations_that_no_soft_robot_bears_are_asked_about(tmp_path: Path) -> None:
    def of(factor: float, name: str = "pressure_pa") -> str:
        rows = "\n".join(f"{p * factor},{u},{m}" for p, u, m in STATES)
        return f"{name},angle_rad,moment_n_m\n{rows}"

    for factor, sentence in ((1e-3, "is it in kPa"), (1e-6, "is it in MPa"), (1e3, "10 MPa")):
        with pytest.raises(UserError, match=sentence):
            read_table(table(tmp_path, of(factor)))
    with pytest.raises(UserError, match="tendon_force_n reaches 10000 N; is it in mN"):
        read_table(table(tmp_path, of(1.0, "tendon_force_n")))
    path = table(tmp_path, of(1.0, "tendon_force_n"), "units: {tendon_force_n: mN}\n")
    assert read_table(path).actuation.max() == pytest.approx(10)
