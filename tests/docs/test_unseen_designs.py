"""docs/designs_you_have_not_solved.md: its commands run and its Python has the results that the page states."""

import re

import pytest
from tests.docs.pages import blocks, commands, page_text, run

PAGE = page_text("designs_you_have_not_solved")


@pytest.mark.slow
@pytest.mark.parametrize("command", commands(PAGE))
def test_commands_on_the_page(command, workplace):
    run(command)
    if "--next" in command:
        assert (workplace / "next/next.csv").is_file()


@pytest.mark.slow
def test_python_on_the_page(workplace, capsys):
    (text,) = blocks(PAGE, "python")
    exec(text.replace('unseen.yaml")', f'unseen.yaml", store="{workplace}/store")'), {})
    worst, covered = (float(number) for number in re.findall(r"([\d.]+) %", capsys.readouterr().out)[:2])
    assert worst < 2.0
    assert covered >= 80
