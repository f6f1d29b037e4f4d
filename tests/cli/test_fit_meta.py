"""`pliant fit` of a study with a meta-model: its printed lines, its JSON and its refusals."""

import csv
import re

import pytest
from tests.pliant_designs import meta_bench as bench


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """Return a folder with a study, its table and a store that keeps the model."""
    folder = tmp_path_factory.mktemp("fit_meta")
    bench.unseen(folder)
    return folder


@pytest.fixture
def fit(pliant, place, workplace):
    """Call `pliant fit` on the study, with the store of the module."""
    return lambda *more: pliant("fit", place / "unseen.yaml", "--store", place / "store", *more)


def test_scores_for_people(fit):
    out = fit().out
    assert "designs  12 from" in out
    assert "radius 4 mm to 5.5 mm" in out
    assert re.search(r"interior +2 ", out) and re.search(r"border +10 ", out)
    assert "in the 90 % band" in out


def test_scores_as_json(fit, read):
    assert fit("--json", "fit.json", "--quiet").code == 0
    result = read("fit.json")
    assert {"rmse", "worst", "worst_of_range", "r2"} <= result["heldout"].keys()
    assert result["parameters"]["names"] == ["radius_m", "length_m"]
    assert result["domain"]["radius_m"] == [4e-3, 5.5e-3]
    assert result["wall_s"] > 0
    assert result["heldout"]["r2"] == result["scores"]["all"]["r2"] > 0.99
    assert 0 < result["coverage"]["all"]["0.9"] <= 1


@pytest.mark.slow
def test_designs_to_solve_next(fit, read, workplace):
    out = fit("--next", "2", "--out", "wanted", "--json", "fit.json").out
    assert "of the mean squared error that solving it would remove" in out
    with (workplace / "wanted" / "next.csv").open() as file:
        rows = list(csv.DictReader(file))
    wanted = read("fit.json")["next"]
    assert [{n: float(v) for n, v in row.items()} for row in rows] == [one["parameters"] for one in wanted]
    assert wanted[0]["gain"] >= wanted[1]["gain"] > 0


def test_next_is_checked_before_anything_is_fitted(fit):
    done = fit("--next", "0").refused("--next 0: ask for at least one design")
    assert "designs" not in done.out


def test_a_study_without_a_meta_model_has_no_next(pliant, write, stated):
    pliant("fit", write(stated), "--next", "1").refused("--next is for a study with a 'meta_model' block")


def test_next_design_in_a_table(pliant, place):
    pliant("fit", place / "fem.csv", "--next", "1").refused("--next is for a study")


@pytest.mark.parametrize(
    ("override", "sentence"),
    [
        ("meta_model.folds=13", "folds is 13, and there are 12 designs"),
        ("meta_model.folds=1", "meta_model.folds"),
        ("meta_model.data=nowhere.csv", "cannot be read"),
        ("meta_model.kind=krigging", "unknown meta_model kind 'krigging'"),
    ],
)
def test_wrong_input_is_one_message(fit, override, sentence):
    fit(override).refused(sentence)


def test_too_few_designs(pliant, place, tmp_path):
    bench.table(tmp_path, (4e-3, 5e-3), (8e-3, 9e-3))
    pliant("fit", bench.unseen(tmp_path, data=tmp_path / "fem.csv"), "--store", place / "store").refused(
        "at least 4 designs and scored on one more, so 4 are too few"
    )


def test_a_run_on_an_unseen_design(pliant, place, read):
    done = pliant(
        "run", place / "unseen.yaml", "--store", place / "store", "--out", "run", "--json", "run.json"
    ).done()
    assert (
        "of an unseen design, radius 4.7 mm, length 8.6 mm, by meta-model 'stand_in' of 12 designs"
        in done.out
    )
    fitted = read("run.json")["fit"]
    assert fitted["meta_model"] == "stand_in"
    assert fitted["inside"] is True
    assert fitted["design"] == {"radius_m": 4.7e-3, "length_m": 8.6e-3}


def test_a_design_outside_the_range(pliant, place):
    pliant("simulate", place / "unseen.yaml", "family.radius=6 mm", "--store", place / "store").refused(
        "family.radius is 6 mm, outside the meta-model's range 4 mm to 5.5 mm", "meta_model.extrapolate: true"
    )
