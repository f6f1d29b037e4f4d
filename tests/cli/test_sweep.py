"""`pliant fem` of a sweep: JSON, table, index, lines, exit codes, Ctrl-C; wrong input gives one sentence."""

import csv
import os
import re
import socket
import subprocess
import sys

import pytest
from tests.cli.conftest import interrupted
from tests.pliant_designs import sweep_bench as bench

GRID = "{radius: [5 mm, 10 mm], length: [9 mm, 11 mm]}"


@pytest.fixture
def fem(pliant, workplace):
    """Call `pliant fem` on the springs with a sweep in this process."""

    def call(sweep, *arguments, workers=1):
        path = bench.study(workplace, sweep)
        return pliant("fem", path, *(["--workers", workers] if workers else []), *arguments)

    return call


def test_the_result_has_the_contracts_keys(fem, read, workplace):
    fem(GRID, "--json", "out.json").done()
    result = read("out.json")
    assert {"pliant", "command", "n_states", "failed", "wall_s", "csv", "designs", "designs_failed"} <= set(
        result
    )
    assert (result["designs_done"], result["designs_refused"], result["designs_failed"]) == (3, 1, 0)
    assert [d["status"] for d in result["designs"]] == ["done", "done", "refused", "done"]
    refused = result["designs"][2]
    assert "short by 1 mm" in refused["cause"]
    assert refused["parameters"]["radius_m"] == pytest.approx(0.01)
    assert result["n_states"] == sum(d["n_states"] for d in result["designs"]) > 0
    for design in result["designs"]:
        assert {"parameters", "status", "cause", "n_states", "wall_s", "key"} <= set(design)
        folder = workplace / ".pliant/store/fem" / design["key"]
        assert bool(design["key"]) == (design["status"] == "done") == (folder / "manifest.json").is_file()
    with open(result["csv"]) as file:  # noqa: PTH123
        rows = list(csv.DictReader(file))
    assert len(rows) == result["n_states"]
    assert {row["design"] for row in rows} == {"0", "1", "3"}
    index = read("runs/springs/sweep.json")
    assert index["designs"] == result["designs"]


def test_lines_for_people_name_designs_and_group_causes(fem):
    call = fem("{radius: [5 mm, 10 mm, 12 mm], length: [9 mm], defect: [none, raises]}")
    assert call.code == 3
    lines = call.out.splitlines()
    assert re.match(r" *design +radius \(mm\) +length \(mm\) +defect +free angle +states +time", lines[0])
    assert re.search(r"5 +9 +none +\d+\.\d\d° +\d+", lines[1])
    causes = [line for line in lines if "springs needs length" in line]
    assert len(causes) == 1
    assert causes[0].startswith("4 refused (designs 2, 3, 4, 5)")
    assert any(line.startswith("1 error (design 1): ZeroDivisionError") for line in lines)
    assert "1 of 6 designs, 4 refused by the family, 1 FAILED" in call.out


@pytest.mark.parametrize(
    ("sweep", "code"),
    [
        ("{radius: [5 mm, 10 mm]}", 0),  # one is refused
        ("{radius: [10 mm]}", 3),  # all are
        ("{defect: [some_states]}", 3),
        ("{defect: [none, stuck]}", 3),
    ],
)
def test_exit_codes(fem, sweep, code):
    assert fem(sweep).code == code


def test_a_second_call_solves_nothing_and_says_so(fem, read):
    fem(GRID)
    call = fem(GRID, "--json", "out.json", workers=None)
    assert "3 from the store" in call.out
    assert [d["cached"] for d in read("out.json")["designs"]] == [True, True, False, True]


@pytest.mark.slow
def test_overrides_change_the_sweep_or_take_it_away(fem, read):
    fem(GRID, "sweep=null", "--json", "one.json", workers=None).done()
    assert "designs" not in read("one.json")
    more = ("sweep.radius=[4 mm]", "sweep.material.shear_modulus=[200 kPa, 300 kPa]", "--json", "out.json")
    assert fem(GRID, *more).code == 0
    result = read("out.json")
    assert result["swept"] == ["radius_m", "length_m", "material.shear_modulus_pa"]
    assert len(result["designs"]) == 4


@pytest.mark.slow
def test_other_verbs_say_that_they_do_not_sweep(pliant, workplace):
    call = pliant("fit", bench.study(workplace, GRID))
    assert "sweep: read, but not used by 'fit'" in call.err


@pytest.mark.slow
def test_a_dask_cluster_solves_it(fem, read):
    distributed = pytest.importorskip("distributed")
    settings = {"n_workers": 1, "threads_per_worker": 1, "dashboard_address": None}
    with distributed.LocalCluster(**settings) as cluster:
        address = cluster.scheduler_address
        call = fem("{radius: [5 mm, 4 mm]}", "--scheduler", address, "--json", "out.json", workers=None)
    assert call.code == 0, call.err
    assert read("out.json")["designs_done"] == 2


MANY = "{low: 1 mm, high: 9 mm, count: 101}"
WRONG = {
    "unknown parameter": ("{radus: [5 mm]}", (), "line 7: 'sweep.radus' is not a parameter of family 'springs'; did"),
    "of the material": ("{shear_modulus: [1 kPa]}", (), "did you mean 'material.shear_modulus'?"),
    "of another block": ("{fem.refinement: [1, 2]}", (), "'sweep.fem.refinement' cannot be swept"),
    "empty list": ("{radius: []}", (), "'sweep.radius' is an empty list"),
    "wrong unit": ("{radius: [5 kg]}", (), "'5 kg' is a mass; it needs a length"),
    "not possible": ("{folds: [1, 0]}", (), "'sweep.folds' is 0"),
    "not a list": ("{radius: 5 mm}", (), "it needs a list such as [a, b] or a range"),
    "not a block": ("[5 mm]", (), "'sweep' is [5 mm]; it needs a block of 'key: value' lines"),
    "nothing": ("{}", (), "'sweep' names no parameter"),
    "doubles": ("{radius: [5 mm, 6 mm, 0.005]}", (), "'sweep.radius' has 5 mm twice (again as 0.005)"),
    "twice by two names": ("{radius: [5 mm], radius_m: [4 mm]}", (), "has radius_m twice"),
    "too many": (f"{{radius: {MANY}, length: {MANY}}}", (), "10201 designs (101 × 101), more than 10000"),
    "range without count": ("{radius: {low: 1 mm, high: 2 mm}}", (), "a range has the keys low, high and count"),
    "range of one": ("{radius: {low: 1 mm, high: 2 mm, count: 1}}", (), "at least 2 as its count"),
    "range upside down": ("{radius: {low: 2 mm, high: 1 mm, count: 3}}", (), "low must be below high"),
    "half folds": ("{folds: {low: 1, high: 2, count: 3}}", (), "'sweep.folds' is 1.5; it should be a whole number"),
    "range of words": ("{defect: {low: none, high: stuck, count: 2}}", (), "is no number, so it has no range"),
    "no table": ("{designs: nowhere.csv}", (), "nowhere.csv: the table of designs cannot be read (No such file"),
    "table and lists": ("{designs: a.csv, radius: [5 mm]}", (), "a table in 'designs' and lists of its own"),
    "no family": (GRID, ("family=null",), "'sweep' varies designs, but the study has no 'family' block"),
    "no material": (GRID, ("material=null",), "'sweep' varies designs, but the study has no 'material' block"),
    "no fem": (GRID, ("fem=null",), "has no 'fem' block; FEM needs one"),
    "no sweep": (GRID, ("sweep=null",), "--workers and --scheduler are for a sweep"),
    "no workers": (GRID, ("--workers", "0"), "workers is 0; it needs a whole number from 1 to"),
    "both": (GRID, ("--scheduler", "tcp://127.0.0.1:9"), "give --workers or --scheduler, not both"),
    "store in a file": (GRID, ("--store", "springs.yaml/store"), "cannot be written"),
    "out in a file": (GRID, ("--out", "springs.yaml/out"), "cannot be written"),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_wrong_input_is_one_sentence(fem, name):
    sweep, arguments, sentence = WRONG[name]
    fem(sweep, *arguments).refused(sentence)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("radius,wdth\n5 mm,1\n", "designs.csv, line 1: 'wdth' is not a parameter of family 'springs'"),
        ("radius,length\n5 mm\n", "designs.csv, line 2: 1 cells, but the header has 2"),
        ("# note\nradius\n5 mm\n5 s\n", "designs.csv, line 4: 'sweep.radius': '5 s' is a time"),
        ("radius\n5 mm\n0.005\n", "has the design of line 2 twice (again as the design of line 3)"),
        ("radius\n", "needs a header of parameters and at least one row"),
        ("radius,radius\n1 mm,2 mm\n", "the header has radius_m twice"),
        ("radius\n\n\n,\n", "line 4: 2 cells, but the header has 1"),
    ],
)
def test_a_wrong_table_names_its_line(fem, workplace, text, sentence):
    (workplace / "designs.csv").write_text(text)
    fem("{designs: designs.csv}").refused(sentence)


@pytest.mark.parametrize(
    ("scheduler", "sentence"),
    [
        ("tcp://127.0.0.1:9", "no scheduler answers at tcp://127.0.0.1:9"),
        ("nowhere://host", "no scheduler answers at nowhere://host"),
        ("scheduler.json", "scheduler.json is no scheduler's file (No such file"),
        ("springs.yaml", "springs.yaml is no scheduler's file (it holds no address)"),
    ],
)
def test_a_scheduler_that_does_not_answer(fem, monkeypatch, scheduler, sentence):
    pytest.importorskip("distributed")
    monkeypatch.setattr("pliant.execution.executors.CONNECT_S", 0.5)
    fem(GRID, "--scheduler", scheduler, workers=None).refused(sentence)
    monkeypatch.setitem(sys.modules, "distributed", None)
    fem(GRID, "--scheduler", scheduler, workers=None).refused("pip install 'pliant[cluster]'")


def test_what_listens_and_says_nothing_is_no_scheduler(fem, monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr("pliant.execution.executors.CONNECT_S", 0.5)
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = f"tcp://127.0.0.1:{server.getsockname()[1]}"
        fem(GRID, "--scheduler", address, workers=None).refused(f"no scheduler answers at {address}")


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "killpg"), reason="POSIX signals")
def test_ctrl_c_ends_all_and_the_same_command_goes_on(workplace, monkeypatch):
    log = workplace / "solved.log"
    monkeypatch.setenv("SPRINGS_LOG", str(log))
    arguments = ["fem", str(bench.study(workplace, GRID)), "--workers", "2", "fem.delay_s=0.1"]
    interrupted(arguments, lambda: sum(bench.solved(log).values()) >= 4)
    command = [sys.executable, "-m", "pliant", *arguments]
    assert subprocess.run(command, capture_output=True, check=False).returncode == 0
    assert len(bench.solved_again(log)) <= 2  # at most one state per worker was interrupted
