"""Text: quoted cells, blocks, comments, numbers."""

import pytest

from pliant_tables import text
from pliant_tables.cells import is_number
from pliant_tables.opening import open_sheet


def test_a_quoted_cell_may_run_over_lines_and_blocks_end_anywhere(tmp_path, monkeypatch):
    path = tmp_path / "t.csv"
    path.write_text('name,value\n"two\nlines",1\nplain,2\n\n# end\nlast,3\n')
    with open_sheet(path, "name,value") as sheet:
        assert sheet.table() == ([3, 4, 7], [["two\nlines", "plain", "last"], ["1", "2", "3"]])
    path.write_text("name,value\n" + "a,1\n" * 50)
    monkeypatch.setattr(text, "BLOCK", 16)
    with open_sheet(path, "name,value") as sheet:
        assert sheet.table()[0] == list(range(2, 52))


def test_comsol_writes_its_header_into_the_last_comment(tmp_path):
    path = tmp_path / "t.csv"
    path.write_text("% Model: finger\n% p,u\n1,2\n3,4\n")
    with open_sheet(path, "p,u") as sheet:
        assert sheet.header == ["p", "u"] and sheet.table()[0] == [3, 4]


@pytest.mark.parametrize(
    ("cell", "holds"), [("1e-3", True), ("nan", True), ("1_5", False), ("", False), ("1,5", False)]
)
def test_what_a_number_is(cell, holds):
    assert is_number(cell) is holds
