"""A scripted user of `python -m benchmarks.page_users` on a small recording that is not in the benchmark's sets."""

from __future__ import annotations

from pathlib import Path

import pytest
from benchmarks.page_users import on_the_page

from .conftest import STUDY, recording
from .test_in_the_browser import CHROMIUM

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed: apt-get install chromium"),
]


def test_a_user_gets_what_improve_gets_and_is_warned(tmp_path: Path) -> None:
    found = on_the_page(recording(), STUDY, ["actuation_gain"], tmp_path, tmp_path / "store")
    assert found["ticked"] and not found["doubts_of_the_right_one"], found
    assert found["within_2_percent"], found["aside"]
    assert found["aside"]["mine"] < 0.3 * found["aside"]["as_it_was"]
    assert not found["false_add"] or found["warned"], found
