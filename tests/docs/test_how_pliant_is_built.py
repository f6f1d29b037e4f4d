"""docs/how_pliant_is_built.md is true of the tree: its files, the order of imports, the dependencies."""

import re
import tomllib

import pytest
from tests.docs.pages import ROOT, blocks, page_text

PAGE = page_text("how_pliant_is_built")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
CONTRACTS = {contract["name"]: contract for contract in PROJECT["tool"]["importlinter"]["contracts"]}
PATHS = sorted(set(re.findall(r"`([\w/]+(?:\.py|\.md|/))`", PAGE)))


def test_the_page_names_files():
    assert len(PATHS) > 60


@pytest.mark.parametrize("path", PATHS)
def test_every_file_that_the_page_names_exists(path):
    assert (ROOT / path).exists() or (ROOT / "core/pliant" / path).exists()


def test_the_import_order_equals_import_linter():
    (order,) = blocks(PAGE, "text")
    layers = CONTRACTS["layers of core, from the outside in"]["layers"]
    assert order.replace("→", " ").split() == [layer.removeprefix("pliant.") for layer in layers]


def test_the_dependencies_equal_the_distribution():
    (sentence,) = re.findall(r"^Core depends on (.*?)\. `numba`", PAGE, re.M | re.DOTALL)
    wanted = [re.split(r"[><=!\[]", name)[0] for name in PROJECT["project"]["dependencies"]]
    assert sorted(re.findall(r"`([\w.]+)`", sentence)) == sorted(wanted)


def test_the_packages_equal_the_wheel():
    packages = PROJECT["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"]
    assert set(packages) <= set(re.findall(r"^\| `([\w/]+)` \|", PAGE, re.M))


def test_every_core_part_has_a_row():
    named = set(re.findall(r"`([\w/.]+)`", PAGE.partition("| part of core |")[2].partition("\n\n")[0]))
    core = ROOT / "core/pliant"
    parts = {f"{path.parent.name}/" for path in core.glob("*/__init__.py")}
    parts |= {path.name for path in core.glob("*.py") if not path.name.startswith("__")}
    assert parts <= named
