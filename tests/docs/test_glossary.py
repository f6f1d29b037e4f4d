"""The glossary defines each term once, and the docs use the standard wording of ../shared/house.md."""

import re
from collections import Counter
from typing import get_args

import pytest
from tests.docs.pages import DOCS, ROOT, page_text

from pliant.diagnosis.verdict import Verdict

ROW = re.compile(r"^\| ([^|]+) \| ((?:[^|\\]|\\.)*) ?\| (.+) \|$", re.M)
# Wording that is not used → the standard wording.
DIALECT = {
    r"tells \d+ %": "explains 23 % of the variance",
    r"worth \d+": "effective sample size 255",
    r"put(s|ting)? aside": "held out",
    r"what is known is not computed": "cached results are reused",
    r"none that I know": "an effect outside the list",
    r"data are mute": "without information",
    r"prior speaks": "the estimate reverts to the prior",
    r"kind is right": "the effect is identified",
    r"form is not (exactly|quite)|not quite ours": "its functional form leaves a residual",
    r"goes beside": "is merged with",
    r"a trial without a number": "failures set `Trial.state`",
    r"study's forms?\b": "published form",
}
PAGES = [ROOT / "README.md", *sorted(DOCS.glob("*.md"))]


def terms() -> list[tuple[str, str]]:
    """Return the terms of the glossary with their meanings."""
    rows = [(term.strip(" `"), meaning) for term, _, meaning in ROW.findall(page_text("glossary"))]
    return [row for row in rows if row[0] != "term"]


def dialect_in(page: str) -> list[str]:
    """Return the wording of a page that is not standard; program output is not its words."""
    prose = re.sub(r"```.*?```", "", page, flags=re.DOTALL)
    prose = " ".join(prose.split())
    return [pattern for pattern in DIALECT if re.search(rf"\b(?:{pattern})", prose, re.IGNORECASE)]


def test_every_glossary_row_is_read():
    rows = [line for line in page_text("glossary").splitlines() if line.startswith("| ")]
    headings = [line for line in rows if line.startswith("| term |")]
    assert len(terms()) == len(rows) - len(headings) > 60


def test_no_term_is_defined_twice():
    counted = Counter(term.lower() for term, _ in terms())
    assert [term for term, count in counted.items() if count > 1] == []


def test_a_meaning_is_one_or_two_sentences():
    lengths = {term: len(re.findall(r"[.](?=\s|$)", meaning)) for term, meaning in terms()}
    assert {term: n for term, n in lengths.items() if n not in (1, 2)} == {}


def test_every_verdict_is_defined():
    assert set(get_args(Verdict)) <= {term for term, _ in terms()}


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.name)
def test_the_docs_use_standard_wording(page):
    assert {pattern: DIALECT[pattern] for pattern in dialect_in(page.read_text(encoding="utf-8"))} == {}


def test_dialect_is_found_across_lines_and_not_in_program_output():
    assert dialect_in("Runs are put\naside, and 3000 readings are worth 250.") == [
        r"worth \d+",
        r"put(s|ting)? aside",
    ]
    assert dialect_in("```\nerror on runs put aside\n```\nOutput, computed worth.") == []
