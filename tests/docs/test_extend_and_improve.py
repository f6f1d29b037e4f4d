"""docs/extend_and_improve.md shows the output and the file of its first command."""

import pytest
from tests.docs.pages import blocks, commands, page_text, run

PAGE = page_text("extend_and_improve")


@pytest.mark.slow
def test_the_first_command_prints_and_writes_what_the_page_shows(workplace):
    printed = run(commands(PAGE)[0])
    shown = blocks(PAGE, "console")[0].splitlines()[1:]
    assert [line.split() for line in shown] == [line.split() for line in printed.splitlines()]
    written = (workplace / "better.yaml").read_text(encoding="utf-8").splitlines()
    wanted = blocks(PAGE, "yaml")[0].splitlines()
    assert wanted[-1].strip() == "…" and written[1 : len(wanted) - 1] == wanted[1:-1]
    base = "examples/hidden_effect/finger.yaml"  # accessed through a link here
    assert wanted[0].startswith(f"extends: {{file: {base},") and written[0].endswith(
        wanted[0].partition(base)[2]
    )
