"""A remark is its text and keeps its rank through the readers."""

import json
import pickle
from dataclasses import replace

import pytest

from pliant.measurements.files import together
from pliant.measurements.floors import floor_remarks, noise_floors
from pliant.measurements.plausible import as_remark
from pliant.measurements.reading import read_measurement
from pliant.records.measurement import Doubt
from pliant.records.remark import Rank, Remark
from pliant.registry.discovery import discover
from pliant.report.fitted import caveat, warned


def test_a_remark_is_its_text_and_survives_what_texts_do():
    said = Remark("a unit", Rank.UNIT)
    assert said == "a unit" and json.dumps([said]) == '["a unit"]'
    again = pickle.loads(pickle.dumps(said))
    assert (again, again.rank) == ("a unit", Rank.UNIT)
    assert (said.from_file("b.csv"), said.from_file("b.csv").rank) == ("b.csv: a unit", Rank.UNIT)
    assert caveat("no rank").rank == Rank.DATA and caveat(said).rank == Rank.UNIT


@pytest.fixture
def read(tmp_path):
    def call(name="a.csv", more=""):
        rows = [f"{0.1 * k:.1f},{k},{k + 0.1 * (-1) ** k:g},7" for k in range(60)]
        (tmp_path / name).write_text("\n".join(["time_s,pressure_kpa,angle_deg,foto", *rows, more]))
        return read_measurement(tmp_path / name)

    return call


def test_ranks_follow_from_what_was_noticed_and_not_from_words(read):
    found = read()
    ranks = {str(text): Remark.from_text(text).rank for text in found.remarks}
    assert ranks["Column 'foto' is not known and ignored."] == Rank.DETAIL
    assert next(rank for text, rank in ranks.items() if "one run only" in text) == Rank.DATA
    two = together([found, replace(read("b.csv", "6.0,0,0,8"), sha256="other")])
    assert all(isinstance(text, Remark) for text in two.remarks)
    (ignored,) = [t for t in two.remarks if "Column 'foto'" in t]  # once for both files
    assert ignored.rank == Rank.DETAIL and ignored.startswith("a.csv and 1 more file: ")
    (floor,) = floor_remarks(noise_floors(found))
    assert floor.rank == Rank.FLOOR
    assert as_remark(Doubt("p", "unit", "p reaches 150.")).rank == Rank.UNIT
    assert as_remark(Doubt("a", "zero", "a begins at 3.")).rank == Rank.DATA


def test_shipped_effects_that_were_left_out_are_folded_by_their_kind():
    leak, mine = (Remark(f"'{kind}' cannot be.", Rank.DETAIL, kind) for kind in ("leak", "mine"))
    notes = warned(discover(), [leak, mine, "plain"])
    assert [note.sentence for note in notes[:2]] == [mine, "plain"]
    assert notes[2].folded and notes[2].items == (leak,)
    assert not any(note.folded for note in warned(discover(), [leak], asked=["leak"]))
