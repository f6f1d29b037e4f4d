"""The navigation, from the lists of links in the pages.

A page of `LISTING` is the parent of the pages that head its list items: docs/index.md lists the sections, a section its
pages, a reference page of an interface its kinds. The site's tree is that of the links in the repository.
"""

from __future__ import annotations

import posixpath
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sphinx.application import Sphinx

ROOT_PAGE = "docs/index"
LISTING = re.compile(r"docs/(index|start|bench|design|plugins|evidence|reference/(\w+/)?index)")
# `- [Title](page.md)`; the rest of the line describes the page.
ITEM = re.compile(r"^- \[[^\]]+\]\(([^)#:\s]+\.md)\)", re.M)


def groups(docname: str, text: str) -> list[tuple[str, list[str]]]:
    """Return the pages that a page lists, as Sphinx names them, with the heading of each group."""
    folder = posixpath.dirname(docname)
    found = []
    for k, part in enumerate(re.split(r"^## ", text, flags=re.M)):
        pages = [posixpath.normpath(posixpath.join(folder, target)) for target in ITEM.findall(part)]
        if pages:
            found.append((part.partition("\n")[0] if k else "", [page.removesuffix(".md") for page in pages]))
    return found


def parents(root: Path, docname: str = ROOT_PAGE) -> dict[str, str]:
    """Return page → the page that lists it, from the root page down.

    Raises:
        ValueError: a page is listed twice.
    """
    made: dict[str, str] = {}
    if not LISTING.fullmatch(docname):
        return made
    text = (root / f"{docname}.md").read_text(encoding="utf-8")
    for child in (page for _, pages in groups(docname, text) for page in pages):
        below = {child: docname, **parents(root, child)}
        if twice := made.keys() & below.keys():
            raise ValueError(f"{docname} lists {', '.join(sorted(twice))} twice")
        made |= below
    return made


def add_toctrees(app: Sphinx, docname: str, source: list[str]) -> None:
    """Append the pages that a page lists as hidden toctrees."""
    if not LISTING.fullmatch(docname):
        return
    for heading, pages in groups(docname, source[0]):
        options = [":hidden:", *([f":caption: {heading}"] if heading else [])]
        source[0] += "\n".join(["", "```{toctree}", *options, "", *(f"/{page}" for page in pages), "```", ""])


def setup(app: Sphinx) -> dict[str, Any]:
    """Connect the navigation to Sphinx."""
    app.connect("source-read", add_toctrees)
    return {"parallel_read_safe": True}
