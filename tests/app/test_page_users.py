"""Two of the scripted users of `python -m benchmarks.page_users`, on small sets of the bed."""

from __future__ import annotations

from pathlib import Path

import pytest
from benchmarks.page_users import played, specs

from .test_in_the_browser import CHROMIUM

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed: apt-get install chromium"),
]


@pytest.mark.parametrize("spec", specs(2, "poor"), ids=lambda spec: spec.kind)
def test_a_user_gets_what_improve_gets_and_is_warned(spec, tmp_path: Path) -> None:
    found = played(spec, tmp_path, tmp_path / "store")
    assert found["ticked"], found
    assert found["within_2_percent"], found["aside"]
    assert found["aside"]["mine"] < 0.8 * found["aside"]["as_it_was"]
    assert not found["false_add"] or found["warned"], found
