"""The page on measurement files names every key of the notes, and the listed words are read as described."""

import re
from pathlib import Path

import pytest

from pliant.config.measurements import JoinedFile, MeasurementNotes, MeasurementsConfig
from pliant.config.study import written_name
from pliant_tables.names import WORDS, meanings

PAGE = (Path(__file__).parents[2] / "docs" / "measurement_files.md").read_text(encoding="utf-8")
ROWS = re.findall(r"^\| `(\w+)` \| ([^|]+) \|$", PAGE.split("### Words")[1].split("<!-- end")[0], re.M)


@pytest.mark.parametrize("model", [MeasurementNotes, MeasurementsConfig, JoinedFile])
def test_every_key_stands_on_the_page(model):
    for field in model.model_fields:
        assert re.search(rf"\b{written_name(model, field)}\b", PAGE), field


def test_every_notes_key_has_a_row():
    table = PAGE.split("| key | says | example |")[1].split("\n\n")[0]
    named = set(re.findall(r"`(\w+)`", table)) | {"conditions"}  # of counts: below
    assert {written_name(MeasurementNotes, field) for field in MeasurementNotes.model_fields} <= named
    assert re.search(r"^conditions:", PAGE.split("## Counts")[1], re.M)


def test_every_listed_word_means_its_column():
    assert len(ROWS) == len(WORDS)
    for column, words in ROWS:
        for word in words.split(", "):
            assert column in meanings(word), word
