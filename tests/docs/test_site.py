"""The documentation site: every page in its navigation, links to headings, the table of commands, its Python reference.

`make docs` builds the whole site with warnings as errors; these are its parts that need no Sphinx.
"""

import importlib.util
import re
import shlex
import sys
from types import ModuleType

import pytest
from tests.docs.pages import DOCS, ROOT, page_text

from pliant.cli.verbs import VERBS

PAGES = sorted(
    path
    for pattern in ("docs/**/*.md", "C*.md", "examples/*/README.md", "contrib/*/README.md")
    for path in ROOT.glob(pattern)
)


def part(name: str) -> ModuleType:
    """Load a file of docs/site."""
    spec = importlib.util.spec_from_file_location(f"site_{name}", DOCS / "site" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def test_every_page_stands_in_the_navigation_once():
    parents = part("navigation").parents(ROOT)
    pages = {path.relative_to(ROOT).as_posix().removesuffix(".md") for path in PAGES}
    assert parents.keys() | {"docs/index"} == pages
    assert [page for page, parent in parents.items() if parent == "docs/index"] == [
        f"docs/{section}"
        for section in ("start", "bench", "design", "plugins", "reference/index", "evidence")
    ]


def test_a_page_that_is_listed_twice_is_named(tmp_path):
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs/index.md").write_text("# All\n\n- [One](start.md): a\n- [Two](two.md): b\n")
    (tmp_path / "docs/start.md").write_text("# One\n\n## Here\n\n- [Two](two.md): again\n")
    with pytest.raises(ValueError, match="docs/index lists docs/two twice"):
        part("navigation").parents(tmp_path)


def anchors(text: str) -> set[str]:
    """Return the anchors of a page's headings, as GitHub and the site generate them."""
    headings = re.findall(r"^#+ (.*)$", re.sub(r"```.*?```", "", text, flags=re.DOTALL), re.M)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_links_to_headings_lead_to_one(page):
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    for target, anchor in re.findall(r"\]\(([^)#:\s]*)#([^)\s]+)\)", text):
        there = page.parent / target if target else page
        assert anchor in anchors(there.read_text(encoding="utf-8")), f"{target}#{anchor}"


def test_the_command_table_has_every_verb_and_its_examples_name_existing_files():
    rows = re.findall(r"^\| \[.*\]\(.*\) \| `pliant (.*)` \|$", page_text("which_command"), re.M)
    assert {row.split()[0] for row in rows} == set(VERBS)
    named = [word for row in rows for word in shlex.split(row) if word.startswith("examples/")]
    assert [name for name in named if not (ROOT / name).is_file()] == []


def test_every_gallery_picture_has_a_caption():
    gallery = part("gallery")
    folder = DOCS / "pictures"
    rows = gallery.rows((folder / "README.md").read_text(encoding="utf-8"), folder)
    pictures = {picture for pictures, _, _ in rows for picture in pictures}
    assert pictures == set(folder.rglob("*.png"))
    shown = gallery.pictures_in_pages(ROOT)
    assert [p.name for p in pictures if not shown[p.relative_to(ROOT).as_posix()].caption] == []


def test_the_python_reference_has_what_the_contract_calls_public():
    api = part("python_api")
    names = api.public_modules()
    assert {"pliant", "pliant.api", "pliant.records.law", "pliant.testing", "pliant.units"} <= set(names)
    assert "pliant.interfaces.effect" not in names  # docs/reference/effect/index.md is its page
    assert (DOCS / "reference" / "effect" / "index.md").is_file()


@pytest.mark.parametrize(
    ("markdown", "expected"),
    [
        (["|u| of a * b, `|u|` and np.str_ are", "text."], [r"\|u\| of a \* b, `|u|` and np.str\_ are", "text."]),
        (["A law:", "", "    M = a * u", "", "with a."], ["A law:", "", "::", "", "    M = a * u", "", "with a."]),
        (["Args:", "    a: b * c", "", "    d: e"], ["Args:", r"    a: b \* c", "", "    d: e"]),
        (["::", "", "    a * b"], ["::", "", "    a * b"]),
    ],
)  # fmt: skip
def test_docstrings_become_restructured_text(markdown, expected):
    part("python_api").from_markdown(None, "", "", None, None, markdown)
    assert markdown == expected
