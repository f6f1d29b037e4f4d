"""FEM tables from elsewhere: units, signs and separators of solvers and benches, and the position of each mistake."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from tests.pipeline.test_tables import WORDS, XYZ, module

from pliant.errors import UserError
from pliant.fem_tables.columns import table_digest
from pliant.fem_tables.reading import read_designs_table, read_module_table, read_table
from pliant.fem_tables.writing import write_table

HEAD, GOOD = "pressure_pa,angle_rad,moment_n_m", "1000,0.1,0.001"


def table(folder: Path, text: str | bytes, notes: str = "", name: str = "fem.csv") -> Path:
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    if notes:
        path.with_suffix(".yaml").write_text(notes, encoding="utf-8")
    return path


def test_the_smallest_table_takes_the_defaults(tmp_path: Path) -> None:
    text = f"\ufeff# from a bench\n\n{HEAD} , note, half_force_n\n1000, 0.1,0, a,1\n# pause\n2000,0.2,-1e-3,b,2\n"
    data = read_table(table(tmp_path, text))
    assert (data.axis, data.actuation_name, len(data)) == ("y", "pressure_pa", 2)
    assert [getattr(data, name).tolist() for name in WORDS] == [
        ["free", "constrained"],
        ["ok"] * 2,
        ["fit"] * 2,
    ]
    assert np.isnan([data.dmoment_dp, data.dmoment_du, data.energy_j]).all()
    assert data.moment_n_m.tolist() == [0.0, -1e-3] and dict(data.design.parameters) == {}
    blank = f"{HEAD},energy_j,role,wall_m,modules\n1,0.1,0,,check,0.0015,8\n2,0.2,0.1,NaN,,0.0015,8\n"
    data = read_table(table(tmp_path, blank))
    assert np.isnan(data.energy_j).all() and data.role.tolist() == ["check", "fit"]
    assert dict(data.design.parameters) == {"wall_m": 0.0015, "modules": 8}
    data = read_table(table(tmp_path, "pressure_pa,extension_m,force_n\n0,0,0\n1000,7.5,0.2\n"))
    assert (data.axis, data.joint, data.branch.tolist()) == ("x", "prismatic", ["free", "constrained"])
    assert data.angle_rad.tolist() == [0.0, 7.5]  # metres: no full turn limits them


AXES = "pressure_pa,angle_rad,moment_n_m,axis\n"


def test_which_axis_to_read_is_asked_or_said(tmp_path: Path) -> None:
    path = tmp_path / "fem.csv"
    write_table(module(XYZ, "y"), path)
    with pytest.raises(UserError, match="one table holds one axis here"):
        read_table(path)
    with pytest.raises(UserError, match="no state explores axis z, only y, x"):
        read_table(table(tmp_path, f"{AXES}1,0.1,0.2,y\n1,0.1,0.2,x\n"), "z")
    data = read_table(table(tmp_path, f"{AXES}1,0.1,0.2,z\n1,0.1,0.2,all\n"), "x")
    assert (data.axis, len(data)) == ("z", 1)
    with pytest.raises(UserError, match="no state explores one axis alone"):
        read_table(table(tmp_path, f"{AXES}1,0.1,0.2,all\n"))


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("", "the table is empty"),
        (f"{HEAD}\n", "a header and no rows"),
        (
            f"# c\npresure_pa,angle_rad,moment_n_m\n{GOOD}",
            "line 2: .*'tendon_force_n' is missing; .* 'presure_pa'",
        ),
        (f"pressure_pa,angle_rad,moment_nm\n{GOOD}", "'moment_n_m' is missing; the file has 'moment_nm'"),
        (f"pressure_pa,half_angle_rad,moment_n_m\n{GOOD}", "twice the half-module angle"),
        ("pressure_pa,extension_m,moment_n_m\n0,0,0\n", "line 1: column 'force_n' is missing"),
        (f"tendon_force_n,{HEAD}\n1,{GOOD}", "driven by tendon_force_n, pressure_pa.*takes one actuation"),
        (f"pressure_1_pa,{HEAD}\n1,{GOOD}", "pressure_pa and pressure_1_pa: number all inputs of a kind"),
        (
            f"tendon_force_n,{HEAD},dmoment_dp\n1,{GOOD},1",
            "does not say by which of tendon_force_n, pressure_pa",
        ),
        (f"tendon_force_n,{HEAD},dmoment_dp_3\n1,{GOOD},1", "slope by input 3.*numbers run from 1 to 2"),
        (f"{HEAD},dmoment_dp_1\n{GOOD},1", "slope by input 1.*leave out '_1'"),
        (
            "p1 (kPa),p2 (kPa),angle_rad,moment_n_m\n1,2,0,0\n",
            r'"p1 \(kPa\)": pressure_1_pa  # by its name and unit\n  "p2 \(kPa\)": pressure_2_pa',
        ),
        (f"{HEAD},angle_rad\n{GOOD},1", "column 'angle_rad' stands 2 times"),
        (f"{HEAD}\n{GOOD}\n1,2", "line 3: 2 cells, but the header has 3"),
        (f"{HEAD}\n{GOOD}\n\n# c\n15 kPa,0.1,0.2", "line 5, column pressure_pa: '15 kPa' is not a number"),
        (f"{HEAD}\n1_000,0.1,0.2", "'1_000' is not a number"),
        (f"{HEAD}\n1,,0.2", "line 2, column angle_rad: it is blank"),
        (f"{HEAD}\n1,0.1,-inf", "column moment_n_m: '-inf' is not a finite number"),
        (f"{HEAD},dmoment_du\n{GOOD},inf", "column dmoment_du: 'inf' is not a finite number"),
        (f"{HEAD}\n{GOOD}\n1,12.5,0.1", "line 3, column angle_rad: 12.5 rad is more than a full turn"),
        (f"{HEAD}\n1,20,2\n", "units: {angle_rad: deg}"),
        (f"{HEAD},branch\n{GOOD},constraned", "did you mean 'constrained'"),
        (f"{HEAD},role\n{GOOD},test", "line 2, column role: 'test' is not one of fit, check"),
        (f"{HEAD},axis\n{GOOD},y\n{GOOD},w", "line 3, column axis: 'w' is not one of x, y, z"),
        (f"{HEAD},axis\n{GOOD},y\n{GOOD},z", "line 3, column axis: it is 'z' after 'y'"),
        (b"\x00\x01\x02pressure", "not a text file"),
        (b"%PDF-1.7\n%\xe2\xe3", "it is a PDF"),
        (b"PK\x03\x04rest", "it is a spreadsheet or an archive"),
        ("1,2,3\n4,5,6\n", "line 1: the first row holds numbers"),
        (
            f"{HEAD}\n1.000,5;0,1;2\n".replace("_pa,", "_pa;").replace("rad,", "rad;"),
            "line 2: '1.000,5' may be read",
        ),
    ],
)
def test_each_problem_has_its_place(tmp_path: Path, text: str | bytes, place: str) -> None:
    path = table(tmp_path, text)
    with pytest.raises(UserError, match=place) as caught:
        read_table(path)
    assert str(caught.value).startswith(str(path))


@pytest.mark.parametrize(
    ("read", "text", "place"),
    [
        (read_designs_table, f"{HEAD},sample\n0,0,0,1\n0,0.1,0,2\n", "every row is a separate design"),
        (read_designs_table, f"{HEAD},design\n0,0,0,1\n0,0.1,0,\n", "line 3, column design: it is blank"),
        (
            read_module_table,
            "pressure_pa,axis,angle_rad,moment_n_m\n0,y,0,0\n0,x,0.1,0.1\n",
            "line 3, column axis: .*angle_x",
        ),
    ],
)
def test_rows_that_make_no_design_are_refused(tmp_path: Path, read, text: str, place: str) -> None:
    with pytest.raises(UserError, match=place):
        read(table(tmp_path, text))


STATES = [(p, u, 1e-6 * p - 0.03 * u) for p in (0.0, 5e3, 1e4) for u in (0.0, 0.1, 0.2)]
PLAIN = f"{HEAD}\n" + "\n".join(f"{p},{u},{m}" for p, u, m in STATES)
NOTES = """\
rename: {"p (kPa)": pressure_pa, theta: angle_rad, "M (N*mm)": moment_n_m}
angle: half_module
moment: sign reversed
"""


def says_the_states(path: Path) -> None:
    data = read_table(path)
    found = np.stack([data.actuation, data.angle_rad, data.moment_n_m], axis=1)
    np.testing.assert_allclose(found, STATES, rtol=1e-12, atol=1e-18)


def in_solver_units(separator: str = ",", decimal: str = ".") -> list[str]:
    """Return the table in kPa, half angles in degrees, moments in N·mm that support the actuation."""
    lines = [(p / 1e3, np.degrees(u) / 2, -1e3 * m) for p, u, m in STATES]
    return [separator.join(repr(float(v)).replace(".", decimal) for v in line) for line in lines]


@pytest.mark.parametrize(
    "head",
    [
        "% Model: bellow.mph\n% Version: COMSOL 6.2\n% p (kPa),theta (deg),M (N*mm)\n",
        "% Model: bellow.mph\np (kPa),theta [deg],M (N*mm)\n",
        "** Abaqus\n** History\np (kPa),theta [deg],M (N*mm)\n",
        "# bench\n\np (kPa),theta (deg),M (N*mm)\n",
    ],
)
def test_solver_headers_are_read_with_their_units(tmp_path: Path, head: str) -> None:
    says_the_states(table(tmp_path, head + "\n".join(in_solver_units()), NOTES))


@pytest.mark.parametrize(("separator", "decimal"), [(";", ","), (";", "."), ("\t", "."), ("\t", ",")])
def test_spreadsheets_with_semicolons_tabs_and_decimal_commas(tmp_path: Path, separator, decimal) -> None:
    head = separator.join(["p (kPa)", "theta (deg)", "M (N*mm)"])
    says_the_states(
        table(tmp_path, "\n".join([head, *in_solver_units(separator, decimal)]), NOTES, name="fem.txt")
    )


def test_a_table_without_notes_keeps_its_bits_and_its_key(tmp_path: Path) -> None:
    path = table(tmp_path, PLAIN)
    assert read_table(path).moment_n_m.tolist() == [m for _, _, m in STATES]
    alone, beside = table_digest(path), path.with_suffix(".yaml")
    beside.write_text("pliant: 1\nname: a study\n")
    assert table_digest(path) == alone
    beside.write_text("moment: sign reversed\n")
    assert table_digest(path) != alone
    np.testing.assert_array_equal(read_table(path).moment_n_m, [-m for _, _, m in STATES])


def test_a_missing_mapping_is_answered_with_lines_that_work(tmp_path: Path) -> None:
    lines = [f"{p / 1e3},{np.degrees(u) / 2},{1e3 * m}" for p, u, m in STATES]
    path = table(tmp_path, "p (kPa),half_angle (deg),M (N*mm)\n" + "\n".join(lines))
    with pytest.raises(UserError, match="is missing") as caught:
        read_table(path)
    path.with_suffix(".yaml").write_text(str(caught.value).split("meant so):\n")[1])
    says_the_states(path)


def test_names_that_say_nothing_are_left_blank_with_what_no_header_says(tmp_path: Path) -> None:
    path = table(tmp_path, "a,b,c\n" + "\n".join(f"{p},{u},{m}" for p, u, m in STATES))
    with pytest.raises(UserError, match="half a module") as caught:
        read_table(path)
    block = str(caught.value).split("meant so):\n")[1]
    assert "angle: module  # or: half_module" in block and "moment: opposes actuation  # or" in block
    path.with_suffix(".yaml").write_text(block)
    with pytest.raises(UserError, match="'rename.a' is empty"):
        read_table(path)
    for name, meant, unit in (
        ("a", "pressure_pa", "Pa"),
        ("b", "angle_rad", "rad"),
        ("c", "moment_n_m", "N*m"),
    ):
        block = re.sub(rf'(rename:[^:]*(?:"\w": .*\n  )*"{name}": ) .*', rf"\g<1>{meant}", block, count=1)
        block = re.sub(rf'"{name}":   # <- its unit', f'"{name}": {unit}', block)
    path.with_suffix(".yaml").write_text(block)
    says_the_states(path)


SLOPED = f"{HEAD},dmoment_dp,dmoment_du,wall_mm\n"


@pytest.mark.parametrize(
    ("notes", "sentence"),
    [
        ("rename: {theta: angle_rad}", "'rename' has 'theta', which is not a column of fem.csv"),
        ("units: {presure_pa: kPa}", "'units' has 'presure_pa'.*did you mean 'pressure_pa'"),
        ("units: {pressure_pa: N}", "fem.yaml: 'units' of 'pressure_pa'"),
        ("units: {pressure_pa: kPaa}", "fem.yaml: 'units' of 'pressure_pa'"),
        ("angle: half", "angle"),
        ("between: {angle_rad: [3, 4]}", "'between' leaves no row of fem.csv"),
        ("between: {angel_rad: [3, 4]}", "'between' has 'angel_rad'.*did you mean 'angle_rad'"),
        ("units: {wall_mm: mm}", "'units' has 'wall_mm', which is read as it stands"),
        ("units: {dmoment_du: N*mm}", "a slope is in the units of its columns"),
    ],
)
def test_notes_that_cannot_be_meant(tmp_path: Path, notes: str, sentence: str) -> None:
    text = SLOPED + "\n".join(f"{p},{u},{m},1e-6,-0.03,1.5" for p, u, m in STATES)
    with pytest.raises(UserError, match=sentence):
        read_table(table(tmp_path, text, notes))


def test_rows_beyond_a_stop_are_left_out(tmp_path: Path) -> None:
    path = table(tmp_path, PLAIN, "between: {angle_rad: [0.05, 0.3]}")
    assert read_table(path).angle_rad.tolist() == [u for _, u, _ in STATES if u >= 0.05]


def drive_table(factor: float, name: str = "pressure_pa") -> str:
    return f"{name},angle_rad,moment_n_m\n" + "\n".join(f"{factor * p},{u},{m}" for p, u, m in STATES)


@pytest.mark.parametrize(("factor", "unit"), [(1e-3, "kPa"), (1e-6, "MPa")])
def test_pressures_in_another_unit_are_noticed(tmp_path: Path, factor: float, unit: str) -> None:
    path = table(tmp_path, drive_table(factor))
    with pytest.raises(UserError, match=rf"units: \{{pressure_pa: {unit}\}}"):
        read_table(path)
    path.with_suffix(".yaml").write_text(f"units: {{pressure_pa: {unit}}}")
    says_the_states(path)
    path.with_suffix(".yaml").write_text("units: {pressure_pa: Pa}")
    assert read_table(path).actuation.max() == pytest.approx(factor * 1e4)


def test_actuations_that_no_soft_robot_bears_are_asked_about(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="10 MPa"):
        read_table(table(tmp_path, drive_table(1e3)))
    with pytest.raises(UserError, match="tendon_force_n reaches 10000 N; is it in mN"):
        read_table(table(tmp_path, drive_table(1.0, "tendon_force_n")))
    path = table(tmp_path, drive_table(1.0, "tendon_force_n"), "units: {tendon_force_n: mN}\n")
    assert read_table(path).actuation.max() == pytest.approx(10)


def test_states_that_contradict_each_other_are_named_by_their_lines(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="lines 3 and 11 contradict each other"):
        read_table(table(tmp_path, PLAIN + "\n0.0,0.1,0.02\n"))


def sloped(by_p: float = 1e-6, by_u: float = -0.03) -> str:
    return f"{HEAD},dmoment_dp,dmoment_du\n" + "\n".join(f"{p},{u},{m},{by_p},{by_u}" for p, u, m in STATES)


def test_slopes_are_in_their_columns_units_and_signs(tmp_path: Path) -> None:
    slopes = f"{-1e3 * 1e-6 * 1e3!r},{1e3 * 0.03 * 2 * np.pi / 180!r}"
    notes = "units: {pressure_pa: kPa, angle_rad: deg, moment_n_m: N*mm}\n" + NOTES.partition("\n")[2]
    text = f"{HEAD},dmoment_dp,dmoment_du\n" + "\n".join(f"{line},{slopes}" for line in in_solver_units())
    path = table(tmp_path, text, notes)
    says_the_states(path)
    np.testing.assert_allclose(read_table(path).dmoment_dp, 1e-6)
    np.testing.assert_allclose(read_table(path).dmoment_du, -0.03)


@pytest.mark.parametrize("slopes", [{"by_u": 0.03}, {"by_u": -0.06}, {"by_p": 1e-3}, {"by_p": -1e-6}])
def test_slopes_that_contradict_the_efforts_are_refused(tmp_path: Path, slopes: dict[str, float]) -> None:
    says_the_states(table(tmp_path, sloped()))
    column = "dmoment_du" if "by_u" in slopes else "dmoment_dp"
    with pytest.raises(UserError, match=f"column {column} contradicts moment_n_m: from line"):
        read_table(table(tmp_path, sloped(**slopes)))


def test_notes_apply_to_columns_on_every_axis(tmp_path: Path) -> None:
    head = "pressure_pa,axis,angle_rad,moment_n_m,angle_x_rad,angle_y_rad,moment_x_n_m,moment_y_n_m,dmoment_x_du_y\n"
    notes = "units: {angle_y_rad: deg, moment_x_n_m: N*mm}\nmoment: sign reversed\n"
    data = read_module_table(table(tmp_path, head + "0,all,0,0,0.1,180,5,6,7\n", notes))
    assert data.deformation[0] == pytest.approx([0.1, np.pi])
    assert data.tau[0] == pytest.approx((-5e-3, -6))
    assert data.dtau_du[0, 0, 1] == pytest.approx(-7e-3 * 180 / np.pi)


def test_slopes_by_the_extension_are_in_its_unit(tmp_path: Path) -> None:
    axes = (
        "angle_x_rad,angle_y_rad,angle_z_rad,extension_e_m,moment_x_n_m,moment_y_n_m,moment_z_n_m,force_e_n"
    )
    head = f"pressure_pa,axis,angle_rad,moment_n_m,{axes},dmoment_y_du_e,dforce_e_du_e,dforce_e_du_y\n"
    text = head + "0,all,0,0,0,90,0,1,0,1,0,2,5,6,7\n"
    data = read_module_table(table(tmp_path, text, "units: {angle_y_rad: deg, extension_e_m: mm}\n"))
    assert data.joint == "extensible"
    assert data.deformation[0] == pytest.approx([0, np.pi / 2, 0, 1e-3])
    assert data.dtau_du[0, 1, 3] == pytest.approx(5e3)
    assert data.dtau_du[0, 3, [3, 1]] == pytest.approx([6e3, 7 * 180 / np.pi])


def test_an_extensible_joint_has_all_its_axes(tmp_path: Path) -> None:
    head = "pressure_pa,axis,angle_rad,moment_n_m,angle_y_rad,extension_e_m,moment_y_n_m,force_e_n\n"
    with pytest.raises(UserError, match="all of the axes x, y, z, e, and the column angle_x_rad is missing"):
        read_module_table(table(tmp_path, head + "0,all,0,0,0.1,0.001,5,6\n"))


def test_several_inputs_from_elsewhere_come_in_any_unit(tmp_path: Path) -> None:
    """Slopes are numbered in the order of the columns, in the units of their quotients."""
    head = "p1 (kPa),p2 (bar),theta (deg),M (N*mm),dmoment_dp_1,dmoment_dp_2\n"
    notes = "rename: {p1 (kPa): pressure_1_pa, p2 (bar): pressure_2_pa, theta (deg): angle_rad, M (N*mm): moment_n_m}"
    data = read_module_table(table(tmp_path, head + "10,0.2,0,3,5,7\n", notes))
    assert data.actuation_name == "pressure_1_pa, pressure_2_pa"
    np.testing.assert_allclose(data.actuation, [[10e3, 20e3]])
    np.testing.assert_allclose(data.dtau_dp, [[[5e-6, 7e-8]]])
    assert np.isnan(data.travel).all() and data.travel.shape == (1, 2)
