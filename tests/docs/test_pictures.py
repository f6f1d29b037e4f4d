"""Every picture of the docs states its source, and every number in the study pages comes from their JSON."""

from __future__ import annotations

import json
import re
from pathlib import Path
from types import ModuleType

import pytest
from benchmarks.studies import gripper_page, reach_page, shape_page
from benchmarks.studies.page import DOCS, MARK, VALUE, rendered, with_noted

ROOT = Path(__file__).resolve().parents[2]
PICTURES = ROOT / "docs" / "pictures"
# Numbers in a page's prose that are not results: settings of a study and parts of names.
STATED = re.compile(
    r"10\.1002/\S+|`[^`]*`|\[[^\]]*\]\([^)]*\)|28°|18 mm|60 mm|5 mm|0\.1 mm|10 %|2026|8 s for one"
)
PRECISE = re.compile(r"\d+\.\d+|\d+ ?(mm|min|%|s|ms)\b|\d+/\d+")


def test_every_picture_has_a_script_or_a_named_report() -> None:
    text = (PICTURES / "README.md").read_text(encoding="utf-8")
    listed = set(re.findall(r"[\w*/]+\.png(?=[,| ])", text.replace("`pictures/", "")))
    shown = {path.name for path in PICTURES.glob("*.png")}
    assert shown == {name for name in listed if "/" not in name and (PICTURES / name).exists()}
    for script in re.findall(r"`python (?:-m )?([\w./]+)", text):
        file = script if script.endswith(".py") else script.replace(".", "/") + ".py"
        assert (ROOT / file).is_file(), script
    for study in re.findall(r"examples/[\w/]+\.(?:yaml|csv)", text):
        assert (ROOT / study).is_file(), study


@pytest.mark.parametrize(
    ("name", "page"),
    [("shape_matching", shape_page), ("gripper_codesign", gripper_page), ("reach_around", reach_page)],
)
def test_numbers_in_a_study_text_come_from_its_json(name: str, page: ModuleType) -> None:
    text = (DOCS / f"{name}.md").read_text(encoding="utf-8")
    result = with_noted(name, json.loads((DOCS / f"{name}.json").read_text(encoding="utf-8")))
    tables = {mark: lambda _, body=body: body.splitlines() for mark, body in _tables(text).items()}
    assert rendered(text, tables, result) == text, "a number in the prose is not what the JSON says"
    changed = json.loads(json.dumps(result), parse_float=lambda number: 3.0 * float(number))
    assert rendered(text, tables, changed) != text
    prose = re.sub(r"```.*?```", "", STATED.sub("", VALUE.sub("", MARK.sub("", text))), flags=re.DOTALL)
    assert not [line for line in prose.splitlines() if PRECISE.search(line)]
    assert page.TABLES.keys() >= _tables(text).keys()


def _tables(text: str) -> dict[str, str]:
    return {found[2]: found[0][len(found[1]) : -len(found[3])].rstrip("\n") for found in MARK.finditer(text)}
