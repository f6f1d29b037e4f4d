"""Files as labs write them are read correctly, or after the user has answered a one-sentence question."""

import re
import time
from pathlib import Path

import pytest
from tests.lab_files.files import lab_files
from tests.lab_files.judge import judge_reading, read
from tests.lab_files.lab_file import LabFile

FILES = {lab.name: lab for lab in lab_files()}
LONGEST_S = 1.5


@pytest.mark.parametrize("lab", FILES.values(), ids=FILES)
def test_a_lab_file(tmp_path: Path, lab: LabFile):
    start = time.process_time()
    reading = read(lab, tmp_path)
    assert time.process_time() - start < LONGEST_S
    if lab.refused:
        assert reading.message, reading.wrong or "it was read"
        assert all(word in reading.message for word in lab.refused), reading.message
        assert one_or_two_sentences(reading.message), reading.message
    else:
        assert not reading.message
        assert judge_reading(lab, reading) == ("doubted" if lab.stated else "right"), reading.wrong
        assert all(word in reading.remarks for word in lab.doubts), reading.remarks
    if not lab.doubts and reading.measurement is not None:
        assert not reading.measurement.doubts, "a file that nobody doubts"
    if lab.stated:
        told = read(lab, tmp_path, lab.stated)
        assert not told.message
        assert not told.wrong and told.measurement is not None
        assert not told.measurement.doubts


def one_or_two_sentences(message: str) -> bool:
    """Return whether a message is short: the mistake, the remedy, and at most a block to paste or a line of a file."""
    text, _, _ = message.partition("\nWrite into")
    text = re.sub(r"\S*/\S+?(?=[:,] )", "FILE", text)
    return len(text) < 500 and text.count("\n") <= 1


def test_every_doubt_begins_with_its_column_and_says_a_line_to_write(tmp_path: Path):
    for lab in FILES.values():
        if lab.doubts:
            found = read(lab, tmp_path).measurement
            assert found is not None and found.doubts
            for doubt in found.doubts:
                assert doubt.sentence.startswith(doubt.column)
                assert doubt.kind == "order" or "write '" in doubt.sentence or "exclude" in doubt.sentence
                assert any(doubt.sentence in remark for remark in found.remarks)
