"""docs/designs_you_have_not_solved.md: its commands run and its Python says what the page says of it."""

import re
import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner

from pliant.cli.verbs import app

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/designs_you_have_not_solved.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    return tmp_path_factory.mktemp("store")


@pytest.fixture
def place(tmp_path, monkeypatch, store):
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PLIANT_STORE", str(store))
    return tmp_path


@pytest.mark.slow
@pytest.mark.parametrize("line", re.findall(r"^\$ pliant (.*)$", PAGE, re.MULTILINE))
def test_commands_of_the_page(line, place):
    result = CliRunner().invoke(app, shlex.split(line))
    assert result.exit_code == 0, result.stderr
    if "--next" in line:
        assert (place / "next" / "next.csv").is_file()


@pytest.mark.slow
def test_python_of_the_page(place, store, capsys):
    (text,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    exec(text.replace('unseen.yaml")', f'unseen.yaml", store="{store}")'), {})
    worst, covered = (float(number) for number in re.findall(r"([\d.]+) %", capsys.readouterr().out)[:2])
    assert worst < 2.0
    assert covered >= 80


def test_messages_of_the_page_are_those_of_the_code():
    core = ROOT / "core/pliant"
    files = [*(core / "pipeline/meta_model").glob("*.py"), core / "interfaces/meta_model.py"]
    code = "".join(file.read_text(encoding="utf-8") for file in files)
    code = re.sub(r'"\s*\n\s*f?"', "", code)
    for message in re.findall(r"^\| ((?:…|folds).*?) \|", PAGE, re.MULTILINE):
        for part in (part.strip() for part in message.split("…")):
            assert part.removesuffix(",") in code or part.removeprefix("is ") in code, part
