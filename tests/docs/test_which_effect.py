"""docs/which_effect.md is correct: its command and its Python run, its tables and thresholds are those of the code."""

import json
import re
from functools import partial
from typing import get_args

import pytest
from tests.docs.pages import ASK_FEW, FEW_EFFECTS, blocks, commands, page_text, run

from pliant import api
from pliant.diagnosis.evidence_table import COINCIDENCE, OUTSIDE, THRESHOLDS
from pliant.diagnosis.excitation import SEPARABLE
from pliant.diagnosis.law_posterior import EXACT, USUAL
from pliant.diagnosis.search import LEFT_BY_LAW, NEAR_BEST
from pliant.diagnosis.verdict import Verdict

PAGE = page_text("which_effect")


@pytest.fixture(scope="module")
def found(workplace):
    """Return the JSON of the page's only command."""
    said = run(commands(PAGE)[0], *ASK_FEW, "--json", "found.json")
    found = json.loads((workplace / "found.json").read_text())
    assert found["report"] in said and (workplace / found["report"]).is_file()
    return found


@pytest.mark.slow
def test_every_key_in_the_json_table_is_there(found):
    table = PAGE[PAGE.index("## JSON") :]
    keys = [key for row in re.findall(r"^\| (`[^|]*) \|", table, re.M) for key in re.findall(r"`(\w+)`", row)]
    assert len(keys) > 15 and set(keys) <= set(found)
    parameters = found["hypotheses"][0]["parameters"]
    assert {"value", "sd", "unit", "plausible"} <= set(next(iter(parameters.values())))


def test_the_verdicts_and_thresholds_equal_the_code():
    rows = re.findall(r"^\| `(\w+)` \|", PAGE[: PAGE.index("## What these")], re.M)
    assert sorted(rows) == sorted(get_args(Verdict))
    text = " ".join(PAGE.split())
    for said in (
        f"− {THRESHOLDS.effect:g} m ln(1 + c) − {THRESHOLDS.third_effect:g} max(m − 2, 0)",
        f"> {THRESHOLDS.excited:g}² + {THRESHOLDS.model_form_tolerance:g} X",
        f"+ {THRESHOLDS.law_form_tolerance:g} X_law",
        f"lowers ln E by at most {THRESHOLDS.reversed_gain:g} relative",
        f"max({THRESHOLDS.rival_form:g} x, D₁) + {COINCIDENCE:g} ln(e / e_best)",
        f"and {100 * THRESHOLDS.unknown_form_tolerance:g} % of what the best other hypothesis explains",
        f"Its penalty is {THRESHOLDS.unknown:g}.",
        f"never below (e / {OUTSIDE:g})²",
        f"exp({1 / THRESHOLDS.temperature:g} ln E)".replace("0.5", "½"),
        f"more than {100 * (1 - LEFT_BY_LAW):g} % of their squared change",
        f"within {NEAR_BEST:g} of the best",
        f"the prior probability {100 * EXACT:g} %",
        f"the median {100 * USUAL.median:g} %",
        f"the maximum is {100 * USUAL.most:g} %",
        f"at least {100 * THRESHOLDS.accepted:g} %",
        f"more than {THRESHOLDS.between_run_scatter:g} times as much",
        f"fewer than {THRESHOLDS.fewest:g} independent",
        f"cannot imitate) < {SEPARABLE:g},",
    ):
        assert said in text, said


def test_the_python_runs(workplace, capsys, monkeypatch):
    monkeypatch.setattr(api, "diagnose", partial(api.diagnose, kinds=FEW_EFFECTS))
    exec(blocks(PAGE, "python")[0], {})
    assert capsys.readouterr().out.startswith("Missing: ")
