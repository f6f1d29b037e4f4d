"""docs/which_effect.md is true: its command and its Python run, its tables and thresholds are those of the code."""

import json
import re
from functools import partial
from typing import get_args

import pytest
from tests.docs.pages import ASK_FEW, FEW_EFFECTS, blocks, commands, run, text_of

from pliant import api
from pliant.diagnosis.evidence_table import THRESHOLDS
from pliant.diagnosis.excitation import SEPARABLE
from pliant.diagnosis.law_posterior import EXACT, USUAL
from pliant.diagnosis.verdict import Verdict

PAGE = text_of("which_effect")


@pytest.fixture(scope="module")
def found(workplace):
    """The JSON of the page's one command."""
    said = run(commands(PAGE)[0], *ASK_FEW, "--json", "found.json")
    found = json.loads((workplace / "found.json").read_text())
    assert found["report"] in said and (workplace / found["report"]).is_file()
    return found


@pytest.mark.slow
def test_every_key_of_the_json_table_is_there(found):
    table = PAGE[PAGE.index("## JSON") :]
    keys = [key for row in re.findall(r"^\| (`[^|]*) \|", table, re.M) for key in re.findall(r"`(\w+)`", row)]
    assert len(keys) > 15 and set(keys) <= set(found)
    parameters = found["hypotheses"][0]["parameters"]
    assert {"value", "sd", "unit", "plausible"} <= set(next(iter(parameters.values())))


def test_the_verdicts_and_thresholds_are_those_of_the_code():
    rows = re.findall(r"^\| `(\w+)` \|", PAGE[: PAGE.index("## What these")], re.M)
    assert sorted(rows) == sorted(get_args(Verdict))
    text = " ".join(PAGE.split())
    for said in (
        f"− {THRESHOLDS.effect:g} m ln(1 + c): Schwarz",
        f"a third effect pays {THRESHOLDS.third_effect:g} more",
        f"any form, and pays {THRESHOLDS.unknown:g}",
        f"the evidences over {THRESHOLDS.temperature:g}",
        f"{THRESHOLDS.excited:g} noise floors, because the smooth form",
        f"a probability of {100 * EXACT:g} % the law is exact",
        f"log-normal about {100 * USUAL.median:g} %",
        f"{100 * THRESHOLDS.model_form_tolerance:g} % of what the best simpler explanation explains",
        f"{100 * THRESHOLDS.unknown_form_tolerance:g} % of what the best listed explanation explains",
        f"has at least {100 * THRESHOLDS.believed:g} %",
        f"more than {THRESHOLDS.between_run_scatter:g} times as much",
        f"fewer than {THRESHOLDS.fewest:g} independent",
        f"< {SEPARABLE:g} at a strength",
    ):
        assert said in text, said


def test_the_python_runs(workplace, capsys, monkeypatch):
    monkeypatch.setattr(api, "diagnose", partial(api.diagnose, kinds=FEW_EFFECTS))
    exec(blocks(PAGE, "python")[0], {})
    assert capsys.readouterr().out.startswith("Missing: ")
