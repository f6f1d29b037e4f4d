"""`pliant fit --out`: the page of a law from a table, from a study and from a meta-model, and cases without a page."""

import re
from html import unescape

import pytest
from tests.pliant_designs import meta_bench as bench

from pliant.fem_tables.writing import write_table
from pliant.formatting import percent
from pliant.testing.samples import sample_table, softening_law

STUDY = """
pliant: 1
name: bench
surrogate: {kind: polynomial, data: law.csv, max_degree: 2}
"""


def words(page):
    return unescape(
        re.sub(r"<[^>]+>", " ", re.sub(r"<style>.*?</style>", "", page.read_text(), flags=re.DOTALL))
    )


@pytest.fixture
def table(workplace):
    write_table(sample_table(softening_law(), noise_n_m=3e-5), workplace / "law.csv")


@pytest.mark.slow
def test_a_studys_law_gets_its_page(pliant, write, read, workplace, table):
    study = write(STUDY)
    done = pliant("fit", study, "--out", "page", "--json", "fit.json")
    assert done.code == 0 and "report   page/fit.html" in done.out
    result, text = read("fit.json"), words(workplace / "page" / "fit.html")
    assert result["report"] == "page/fit.html"
    assert f"within {percent(result['heldout']['worst_of_range'])} of the table" in text
    assert "How many states it takes" in text
    assert "How many states it takes" not in words_without_learning(pliant, study, workplace)


def words_without_learning(pliant, study, workplace):
    assert pliant("fit", study, "--out", "short", "--no-learning", "--quiet").code == 0
    return words(workplace / "short" / "fit.html")


@pytest.mark.slow
def test_a_tables_law_gets_its_page_beside_the_study(pliant, workplace, table):
    assert pliant("fit", "law.csv", "--kind", "table", "--out", "law", "--no-learning", "--quiet").code == 0
    text = words(workplace / "law" / "fit.html")
    assert "of law.csv on" in text and (workplace / "law" / "study.yaml").is_file()
    assert "the published form, least squares" in text


def test_a_stated_law_has_no_page(pliant, write, stated, workplace):
    pliant("fit", write(stated), "--out", "page").refused(
        "stated by its coefficients: there is no fit, so leave out --out"
    )
    assert not (workplace / "page" / "fit.html").exists()


def test_a_folder_that_cannot_be_written_is_refused_first(pliant, write, workplace, table):
    (workplace / "file").write_text("")
    pliant("fit", write(STUDY), "--out", "file/page").refused("cannot be written")


@pytest.mark.slow
def test_a_meta_models_page_with_what_to_solve_next(pliant, read, workplace):
    bench.unseen(workplace)
    pliant("fit", "unseen.yaml", "--next", "2", "--out", "page", "--no-learning", "--json", "fit.json").done()
    result, text = read("fit.json"), words(workplace / "page" / "fit.html")
    assert result["report"] == "page/fit.html"
    assert percent(result["scores"]["all"]["axes"]["y"]["worst_of_range"], 3) in text
    assert "Solve these next" in text and "How many designs it takes" not in text
