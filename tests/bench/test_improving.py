"""The improved study announces what it has beside the verdict, in words, in JSON, in the report and in its file."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from pliant_bench.loop.decision import Ended
from pliant_bench.loop.folder import ExperimentFolder
from pliant_bench.loop.improving import AddedBlock, ImprovedStudy, added_blocks
from pliant_bench.loop.report import experiment_document


@dataclass(frozen=True)
class TakenStep:
    """What `added_blocks` reads of a step."""

    added: tuple[str, ...]
    cause: str = "named"
    why: str = "It predicts better."
    learned: Any = None
    stands_for: tuple[str, ...] = field(default=())

    @property
    def named(self) -> str:
        return "the law's own error" if self.cause == "law" else " + ".join(self.added)


def verdict(
    kind: str = "missing_effect", selected: tuple[str, ...] = ("friction_hysteresis",), **more: Any
) -> dict[str, Any]:
    return {"verdict": kind, "selected": list(selected), "selected_class": [], "beside_class": [], **more}


def blocks(found: dict[str, Any], *steps: TakenStep) -> list[tuple[str, bool]]:
    improvement: Any = SimpleNamespace(steps=(TakenStep((), ""), *steps))
    return [(one.name, one.in_verdict) for one in added_blocks(improvement, found)]


LAW = TakenStep(("learned",), "law", learned=object())


def test_only_what_the_verdict_names_is_of_the_verdict() -> None:
    found = blocks(verdict(), TakenStep(("friction_hysteresis",)), TakenStep(("supply_lag",), "open"), LAW)
    assert found == [("friction_hysteresis", True), ("supply_lag", False), ("the law's own error", False)]


def test_a_stand_in_of_the_class_is_of_the_verdict() -> None:
    found = verdict(
        "ambiguous", (), selected_class=["stiffness", "wall_thickness"], beside_class=["backlash"]
    )
    assert blocks(found, TakenStep(("stiffness",), "class"), TakenStep(("backlash",), "named")) == [
        ("stiffness", True),
        ("backlash", True),
    ]


def test_a_law_that_is_off_is_of_its_verdict_and_a_learned_curve_of_none() -> None:
    learned = TakenStep(("learned",), "learned", learned=object())
    assert blocks(verdict("law_off", ()), LAW) == [("the law's own error", True)]
    either = verdict("ambiguous", (), selected_class=["law", "stiffness"])
    assert blocks(either, LAW) == [("the law's own error", True)]
    assert blocks(verdict("unknown_effect", ()), learned) == [("learned", False)]


ADDED = (
    AddedBlock("friction_hysteresis", True, "The runs support it."),
    AddedBlock("the law's own error", False, "A smooth surface corrects it."),
)


def test_every_block_beside_the_verdict_is_announced() -> None:
    said = ImprovedStudy(Path("improved.yaml"), ADDED, (), "").sentences
    assert said[0] == "improved.yaml has friction_hysteresis, which the verdict names."
    assert said[1] == (
        "improved.yaml also has the law's own error, which the verdict does not name. A smooth surface corrects it."
    )
    assert "Remove its block" in said[2]


def test_what_the_verdict_names_and_the_study_lacks_is_announced() -> None:
    said = ImprovedStudy(Path("improved.yaml"), ADDED[1:], ("backlash",), "No gain.").sentences
    assert said[-1] == "It does not have backlash, which the verdict names. No gain."
    assert ImprovedStudy(None, (), (), "No gain.").sentences == ("No improved study was written. No gain.",)


@pytest.mark.parametrize(
    "improved", [ImprovedStudy(Path("improved.yaml"), ADDED, (), ""), ImprovedStudy(None, (), (), "No gain.")]
)
def test_the_report_says_what_the_model_has_and_why(tmp_path: Path, improved: ImprovedStudy) -> None:
    document = experiment_document(
        "finger", ExperimentFolder(tmp_path), Ended("verdict", "It held."), 3.0, improved
    )
    assert document.data["improved"] == improved.json()
    assert set(improved.sentences) <= set(document.closing)
    (section,) = [one for one in document.draw().sections if one.title == "The improved study"]
    assert section.text == improved.sentences
    assert [row[1:] for table in section.tables for row in table.rows] == [
        ["yes" if one.in_verdict else "no", one.why] for one in improved.added
    ]
