"""`pliant optimize`: its results, files, exit codes, interruption and wrong input."""

import csv
import json
import os
import re
import sys

import pytest
from tests.cli.conftest import interrupted
from tests.cli.search_study import BUDGET, STUDY

from pliant import api
from pliant.config.loading import load_study
from pliant.registry.discovery import discover
from pliant_search.report.folder import read_search

pytest.importorskip("cma")


@pytest.fixture(autouse=True)
def page_or_none(request, monkeypatch):
    """Replace the page by an empty one, since pictures take longer than the search, unless `real_page` is used."""
    if "real_page" not in request.fixturenames:
        monkeypatch.setattr(
            "pliant_search.command.write_search_page", lambda folder, *_: folder / "search.html"
        )


@pytest.fixture
def real_page():
    pass


@pytest.fixture
def path(write):
    return write(STUDY)


@pytest.fixture
def optimize(pliant, path):
    """Call `pliant optimize` on the study in this process."""

    def call(*arguments, workers=1):
        return pliant("optimize", path, *(["--workers", workers] if workers else []), *arguments)

    return call


@pytest.fixture
def found(optimize, read):
    """Return the JSON of a search that ends with exit code 0."""

    def call(*arguments, **more):
        optimize(*arguments, "--json", "out.json", **more).done()
        return read("out.json")

    return call


def without_times(result):
    rows = [{k: v for k, v in row.items() if k != "wall_s"} for row in result["history"]]
    return rows, result["best"], result["evaluations"], result["slopes"]


def test_what_is_found_is_in_the_json_on_the_terminal_in_the_table_and_in_a_study_that_runs(
    optimize, read, pliant, workplace
):
    call = optimize("--json", "out.json").done()
    result, best = read("out.json"), read("out.json")["best"]
    assert {"best", "objective", "history", "evaluations", "wall_s", "verified"} <= set(result)
    assert result["evaluations"] == len(result["history"]) == BUDGET
    assert result["objective"] == pytest.approx(0.0, abs=2e-4)
    assert best["metrics"]["tip_x_m"] == pytest.approx(0.010, abs=2e-4)
    assert list(best["design"]) == ["chain.module_length_m"]
    assert list(best["controls"]) == ["task.pressure_pa"]
    assert 2e3 <= best["controls"]["task.pressure_pa"] <= 14e3
    assert set(result["verified"]["engines"]) == set()  # a stated law: there is no FEM to check
    assert result["history"][-1]["best"] == result["objective"]
    counted = f"{BUDGET} evaluations with {BUDGET} simulations"
    for words in ("best     ", "mm", "kPa", counted, "slope    task.pressure", "predicted"):
        assert words in call.out
    assert call.out.count("slope    ") <= 3
    with (workplace / "runs/toy/history.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == BUDGET
    assert {"task.pressure_pa", "chain.module_length_m", "tip_x_m", "status", "wall_s"} <= set(rows[0])
    miss = [abs(float(row["tip_x_m"]) - 0.010) for row in rows]
    assert [float(row["abs(tip_x - 10 mm)"]) for row in rows] == pytest.approx(miss)
    assert json.loads((workplace / "runs/toy/optimize.json").read_text())["objective"] == min(miss)
    text = (workplace / "runs/toy/best.yaml").read_text()
    assert text.startswith("# Found by 'pliant optimize'")
    assert "extends: {file: ../../study.yaml, values_sha256: " in text
    again = pliant("simulate", "runs/toy/best.yaml", "--json", "again.json").done()
    assert again.err == ""
    assert read("again.json")["metrics"]["tip_x_m"] == pytest.approx(best["metrics"]["tip_x_m"], abs=1e-9)
    second = optimize("--json", "out.json")
    assert read("out.json")["stages"][0]["cached"] and "searching" not in second.err
    checked = optimize("search.verify.change={task.pressure: 5 kPa}", "--json", "out.json").done()
    assert read("out.json")["stages"][0]["cached"] and "check" in checked.err


def test_an_objective_that_is_a_key_has_its_unit(optimize):
    call = optimize("search.objective=task.pressure", "search.verify=null", "search.budget=6")
    assert re.search(r"best     task\.pressure \S+ kPa\n", call.out)
    assert re.search(r"slope    task\.pressure: 0\.12 kPa for 1 % of its range", call.out)


@pytest.mark.slow
def test_the_page_draws_the_best_design_as_it_was_evaluated(optimize, workplace, real_page):
    optimize("search.budget=6").done()
    assert (workplace / "runs/toy/search.html").is_file()
    _, result, drawn = read_search(workplace / "runs/toy")
    assert [one.label for one in drawn] == ["best"]
    assert drawn[0].rest_m.shape == (5, 3)
    assert drawn[0].result.metrics["tip_x_m"] == result.best[0].metrics["tip_x_m"]


def test_designs_spread_over_a_front_are_drawn(optimize, workplace, monkeypatch):
    pytest.importorskip("optuna")
    pages = []
    monkeypatch.setattr(
        "pliant_search.command.write_search_page", lambda *page: pages.append(page) or workplace
    )
    objectives = "search.objective=[tip_x, {maximize: tip_z}]"
    optimize("optimizer={kind: optuna, sampler: random}", objectives, "search.budget=60").done()
    ((_, _, result, drawn),) = pages
    numbers = [int(one.label.removeprefix("design ")) - 1 for one in drawn]
    assert len(result.best) > 4 == len(drawn)
    assert (numbers[0], numbers[-1]) == (0, len(result.best) - 1)
    for one, design in zip(drawn, (result.best[k] for k in numbers), strict=True):
        assert one.result.metrics["tip_z_m"] == design.metrics["tip_z_m"]


def test_a_study_that_extends_another_gives_a_winner_too(run_json, write, workplace):
    write(STUDY, "base.yaml")
    write("extends: base.yaml\npliant: 1\nname: child\nsearch: {budget: 12}\n")
    best = run_json("optimize", "study.yaml", "--workers", 1)["best"]
    study = load_study(workplace / "runs/child/best.yaml", discover())
    assert study.block("search") is None
    assert study.task.pressure_pa == best["controls"]["task.pressure_pa"]
    run_json("optimize", "study.yaml", "--workers", 1, "--full", "--out", "alone")
    assert "extends" not in (workplace / "alone/best.yaml").read_text()
    assert load_study(workplace / "alone/best.yaml", discover()).canonical() == study.canonical()


def test_overrides_are_searched_and_written(found, workplace):
    assert found("chain.modules=4", "search.budget=6", "--out", "there")["evaluations"] == 6
    assert load_study(workplace / "there/best.yaml", discover()).chain.modules == 4


@pytest.mark.slow
def test_workers_a_dask_cluster_and_the_interface_in_python_find_the_same(found, path):
    one = found("search.budget=12", "--store", "a")
    two = found("search.budget=12", "--store", "b", workers=2)
    assert without_times(one) == without_times(two)
    result = api.optimize(api.open_study(path, ["search.budget=12"], store="c"), workers=1)
    assert result.best[0].values == one["best"]["values"]
    distributed = pytest.importorskip("distributed")
    settings = {"n_workers": 1, "threads_per_worker": 1, "dashboard_address": None}
    with distributed.LocalCluster(**settings) as local:
        scheduler = ("--scheduler", local.scheduler_address, "--store", "d")
        there = found("search.budget=12", *scheduler, workers=None)
    assert without_times(there) == without_times(one)


def test_a_larger_budget_goes_on(optimize, found, read):
    found("search.budget=6")
    assert "going on from" in optimize("search.budget=18", "--json", "more.json").err
    assert without_times(read("more.json")) == without_times(found("search.budget=18", "--store", "fresh"))


@pytest.mark.slow
def test_until_ends_it(found):
    result = found("search.until=tip_x <= 10.5 mm and tip_x >= 9.5 mm")
    assert result["stopped"] == "until" and result["evaluations"] < BUDGET


def test_each_value_has_a_separate_search(found):
    result = found("search.variables.n={key: chain.modules, low: 2, high: 3, each: true}", "search.budget=8")
    assert [branch["n"] for branch in result["branches"]] == [2, 3]
    assert result["evaluations"] == 16
    assert [row["branch"] for row in result["history"]] == [0] * 8 + [1] * 8
    assert result["best"]["design"]["chain.modules"] in (2, 3)


def test_conditions_are_all_tried_and_each_gets_a_study(found, workplace):
    conditions = "search.conditions={light: {chain.payload: 0 g}, heavy: {chain.payload: 5 g}}"
    result = found(conditions, "chain.gravity=[0, 0, -9.81]", "search.budget=8")
    assert set(result["best"]["conditions"]) == {"light", "heavy"} and result["simulations"] == 16
    heavy, light = (
        load_study(workplace / f"runs/toy/best-{name}.yaml", discover()) for name in ("heavy", "light")
    )
    assert (light.chain.payload_kg, heavy.chain.payload_kg) == (0.0, 0.005)
    assert heavy.task.pressure_pa == light.task.pressure_pa


def test_conditions_whose_names_make_one_file_name_get_two_files(optimize, workplace):
    conditions = "search.conditions={'egg (5 g)': {chain.payload: 5 g}, 'egg [5 g]': {chain.payload: 6 g}}"
    optimize(conditions, "search.budget=6", "search.verify=null").done()
    files = workplace.glob("runs/toy/best-*")
    written = {file.name: load_study(file, discover()).chain.payload_kg for file in files}
    assert written == {"best-egg__5_g_-1.yaml": 0.005, "best-egg__5_g_-2.yaml": 0.006}


def test_the_best_design_is_not_written_over_the_study(pliant, write):
    path = write(STUDY, "best.yaml")
    call = pliant("optimize", "best.yaml", "--out", ".", "--workers", 1)
    call.refused("the best design would be written over best.yaml; give another --out.")
    assert path.read_text() == STUDY


def test_the_history_in_a_very_long_search_is_thinned_to_its_end(found, monkeypatch):
    monkeypatch.setattr("pliant_search.report.folder.MOST_ROWS", 7)
    result = found("search.verify=null")
    rows = [row["row"] for row in result["history"]]
    assert len(rows) == 7 and (rows[0], rows[-1]) == (0, BUDGET - 1)
    assert result["history"][-1]["best"] == result["objective"]


def test_an_objective_that_is_no_number_is_counted_and_survived(found):
    result = found("search.objective=abs(tip_x - 10 mm) + 0 * log(task.pressure - 4 kPa)")
    (cause,) = result["failed"]
    assert "nan" in cause
    lost = [row for row in result["history"] if row["status"] == "not_a_number"]
    assert len(lost) == result["failed"][cause] > 0
    assert all(row["values"]["task.pressure"] < 4e3 for row in lost)
    assert result["evaluations"] == BUDGET


@pytest.mark.slow
def test_nothing_feasible_exits_with_3_and_leaves_nothing_from_the_search_before(
    optimize, workplace, real_page
):
    optimize("search.budget=6", "search.verify=null").done()
    call = optimize("search.constraints=[tip_x >= 1 m]", "search.budget=6").done(3)
    assert "nothing feasible was found in 6 evaluations" in call.err
    result = json.loads((workplace / "runs/toy/optimize.json").read_text())
    assert (result["best"], result["report"]) == (None, "runs/toy/search.html")
    assert not (workplace / "runs/toy/best.yaml").exists()
    page = (workplace / result["report"]).read_text()
    assert "No design was found among 6 candidates: 0 refused, 0 failed, 6 simulated that break a con" in page


def test_the_other_verbs_say_whose_keys_these_are(pliant, path):
    said = pliant("simulate", path).done().err
    assert "search, optimizer: for 'pliant optimize'; 'simulate' takes the study as it is" in said


WRONG = {
    "no search": (("search=null",), "has no 'search' block; 'pliant optimize' needs one"),
    "no chain": (("chain=null",), "has no 'chain' block"),
    "no task": (("task=null",), "has no 'task' block"),
    "unknown optimizer": (("optimizer=cmeas",), "unknown optimizer kind 'cmeas'; did you mean 'cmaes'?"),
    "bounds reversed": (("search.variables.task.pressure={low: 9 kPa, high: 2 kPa}",), "low"),
    "unknown metric": (("search.objective=rmse",), "rmse"),
    "both": (("--scheduler", "tcp://127.0.0.1:9"), "give --workers or --scheduler, not both"),
    "infeasible": (("search.constraints=[task.pressure >= 1 MPa]",), "task.pressure >= 1 MPa"),
    "verify.change": (("search.verify.change={task.presure: 5 kPa}",), "did you mean 'pressure'"),
    "verify.change's value": (("search.verify.change={task.steps: many}",), "search.verify.change"),
    "a target out of reach": (
        (
            "task={kind: follow_shape, pressure: 15 kPa, target: {radius: 30 mm, height: 30 mm, turns: 3}}",
            "search.objective=rmse",
        ),
        "mm long, and the longest chain that the search can build 36 mm",
    ),
    "out in a file": (("--out", "study.yaml/out"), "cannot be written"),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_input_is_one_sentence(optimize, name, workplace):
    arguments, sentence = WRONG[name]
    optimize(*arguments).refused(sentence)
    written = [file.name for file in workplace.rglob("*") if file.is_file() and file.stat().st_size]
    assert written == ["study.yaml"]


def test_wrong_workers_are_one_sentence(optimize, monkeypatch):
    optimize(workers="0").refused("workers is 0")
    optimize("--scheduler", "nowhere.json", workers=None).refused("nowhere.json is no scheduler's file")
    monkeypatch.setitem(sys.modules, "cma", None)
    optimize().refused("pip install 'pliant[search]'")


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "killpg"), reason="POSIX signals")
def test_ctrl_c_ends_it_and_the_same_command_goes_on(path, workplace):
    arguments = ("optimize", path, "search.budget=4000", "--workers", 2)
    interrupted(arguments, lambda: list(workplace.glob(".pliant/store/search/*.partial/*.jsonl")))
