"""Every mistake in a measurement file is reported with its line, in one message and without a traceback."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pliant.config.measurements import MeasurementsConfig
from pliant.errors import UserError
from pliant.measurements.reading import read_measurement
from pliant.records.measurement import Measurement

HEAD = "run,time_s,pressure_pa,angle_rad\n"
GOOD = HEAD + "A,0,0,0\nA,1,1e4,0.5\nB,0,0,0\nB,1,1e4,0.5\n"


@pytest.fixture
def complaint(read):
    def complained(content, notes="", **arguments) -> str:
        with pytest.raises(UserError) as error:
            read(content, notes, **arguments)
        return str(error.value)

    return complained


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("# only a comment\n\n", "the table is empty"),
        (HEAD + ",,,\n", "a header and no rows"),
        (HEAD.strip() + ",angle_rad\n", "column 'angle_rad' stands 2 times"),
        (HEAD.strip() + ",angle_deg\nA,0,0,0,0\n", "'angle_rad' and 'angle_deg' both mean angle_rad"),
        (HEAD + "A,0,0,abc\n", "line 2: column angle_rad: 'abc' is not a number; leave missing"),
        (
            HEAD + 'A,0,"1,5",0.5\n',
            "line 2: column pressure_pa: '1,5' is not a number; decimals need a point",
        ),
        (HEAD + "A,0,1_000,0\n", "line 2: column pressure_pa: '1_000' is not a number"),
        (HEAD + "A,0,inf,0\n", "line 2: column pressure_pa is infinite"),
        (HEAD + "A,0,0,1e999\nA,1,x,0\n", "line 2: column angle_rad is infinite"),
        (HEAD + "A,0,0,0,5\n", "line 2: 5 cells, but the header has 4 (decimals need a point, not a comma)"),
        (HEAD + 'A,0,0,0\n"A,1,0,0\nA,2,0,0\n', "line 3: it cannot be read as CSV"),
        (HEAD + " ,0,0,0\n", "line 2: column run is blank"),
        (HEAD + "A,0,0,0\nA,2,0,0\nA,1,0,0\n", "line 4: time_s goes back from 2 to 1 in run 'A'"),
        (HEAD + "A,1,0,0\nB,0,0,0\nA,0,0,0\n", "line 4: run 'A' begins again with time_s 0 after 1"),
        (HEAD + "A,1,0,0\nA,1,0,0.1\n", "line 3: time_s is 1 again in run 'A', with other values"),
        (HEAD + "A,0,,0\nA,1,nan,0\n", "no row can be used; pressure_pa is blank in 2 of them (lines 2, 3)"),
        (HEAD + "A,0,0,\nA,1,0,nan\n", "no reading is left of angle_rad"),
        ("run,time_s,angle_rad\nA,0,0\n", "no column drives the chain"),
        ("run,time_s,pressure_pa,bend\nA,0,0,0\n", "nothing is measured"),
        ("run,specimen,pressure_pa,angle_rad\nA,s,0,0\nA,t,0,0\n", "line 3: specimen 't' in run 'A'"),
        (HEAD.strip() + ",sigma_angle_rad\nA,0,0,0,0\n", "line 2: sigma_angle_rad should be above 0"),
    ],
)
def test_a_wrong_file(complaint, content, words):
    message = complaint(content)
    assert "bench.csv" in message and words in message


def test_many_problems_come_in_one_message(complaint):
    rows = "".join(f"A,{i},0,{'bad' if i % 2 else 0}\n" for i in range(100))
    message = complaint(HEAD + rows + "A,0,0,0\n")
    assert "51 problems" in message and "… and 31 more" in message
    assert message.count("\n") == 2 and "lines 3, 5, 7, " in message and ", 41: " in message


def test_hopeless_files_are_not_read_to_the_end(complaint):
    message = complaint(HEAD + "A,0,0,bad\n" * 20_000)
    assert "reading stopped at line 10001" in message


def test_a_run_per_row_is_no_run(complaint):
    rows = "".join(f"{i},0,0,0\n" for i in range(10_001))
    assert "more than 10000 runs" in complaint(HEAD + rows)


def test_one_endless_line(complaint, monkeypatch):
    monkeypatch.setattr("pliant_tables.text.BLOCK", 1000)
    assert "too long for a table row" in complaint(HEAD + "1" * 5000)
    assert "too long for a table row" in complaint("1" * 5000)


@pytest.mark.parametrize(
    ("notes", "words"),
    [
        (
            "rename: {bent: angle_rad}\n",
            "bench.yaml, line 1: 'rename' has 'bent', which is not a column of bench.csv",
        ),
        ("rename: {angle_rad: angel_rad}\n", "not a column of a measurement; did you mean 'angle_rad'?"),
        ("units: {presure_pa: kPa}\n", "did you mean 'pressure_pa'?"),
        (
            "units: {pressure_pa: mm}\n",
            "column 'pressure_pa': the unit 'mm' is a length; it needs a pressure",
        ),
        ("units: {run: mm}\n", "column 'run' has no unit"),
        ("sigma: {angle: 1 deg}\n", "'sigma' has 'angle', which is not an output; did you mean 'angle_rad'?"),
        ("sigma: {angle_rad: -1}\n", "sigma of 'angle_rad' is -1.0; it should be above 0"),
        ("sigma: {angle_rad: 1 mm}\n", "it needs an angle"),
        ("exclude: [{run: C}]\n", "'exclude' names run 'C', which is not there"),
        ("exclude: [{run: A, start: 2, end: 1}]\n", "'end' is before 'start'"),
        ("exclude: [{run: A, start: 2, lines: [1, 2]}]\n", "not both"),
        ("renames: {}\n", "line 1: 'renames' is not a key of this file; did you mean 'rename'?"),
        ("rename: [\n", "this is not YAML"),
    ],
)
def test_wrong_notes(complaint, notes, words):
    assert words in complaint(GOOD, notes)


def test_what_the_chain_or_the_study_needs_is_not_there(complaint):
    message = complaint(GOOD, actuation=["pressure_1_pa"])
    assert "driven by 'pressure_1_pa'" in message and "it has pressure_pa" in message
    settings = MeasurementsConfig(file="bench.csv", outputs=("tip_x_m",))
    assert "asks for output 'tip_x_m', which bench.csv does not have" in complaint(GOOD, settings=settings)


def test_no_file_and_a_folder(tmp_path):
    for path in (tmp_path / "no.csv", tmp_path):
        with pytest.raises(UserError, match="cannot be read"):
            read_measurement(path)


@given(
    st.integers(0, len(GOOD)),
    st.integers(0, 12),
    st.one_of(st.binary(max_size=12), st.text('",;\n\r#-.e0 9A_', max_size=12).map(str.encode)),
)
def test_corruption_is_read_or_told(tmp_path_factory, start, length, put):
    path = tmp_path_factory.mktemp("corrupt") / "bench.csv"
    raw = GOOD.encode()
    path.write_bytes(raw[:start] + put + raw[start + length :])
    try:
        assert isinstance(read_measurement(path), Measurement)
    except UserError as error:
        assert "bench" in str(error)
