"""The gallery: the list of pictures in docs/pictures/README.md, with each picture, its caption and its source.

A caption is the alternative text of the page that shows the picture, so that it is written once.
"""

from __future__ import annotations

import os
import posixpath
import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from sphinx.application import Sphinx

GALLERY = "docs/pictures/README"
IMAGE = re.compile(r"!\[([^\]]*)\]\(([^)\s]+\.png)\)")


class Shown(NamedTuple):
    """The page that shows a picture.

    Attributes:
        page: path of the page from the repository's root.
        title: of the page.
        caption: the page's description of the picture.
    """

    page: str
    title: str
    caption: str


def pictures_in_pages(root: Path) -> dict[str, Shown]:
    """Return path of a picture from the repository's root → the first page that shows it."""
    found: dict[str, Shown] = {}
    for path in sorted((root / "docs").rglob("*.md"), key=lambda path: (len(path.parts), path)):
        text = path.read_text(encoding="utf-8")
        page = path.relative_to(root).as_posix()
        for caption, target in IMAGE.findall(text):
            picture = posixpath.normpath(posixpath.join(posixpath.dirname(page), target))
            title = text.partition("\n")[0].removeprefix("# ")
            found.setdefault(picture, Shown(page, title, caption))
    return found


def rows(text: str, folder: Path) -> Iterator[tuple[list[Path], str, str]]:
    """Return the pictures of each row of the list, their source, and the text about them."""
    for line in text.splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")] if line.startswith("|") else []
        names = re.findall(r"[\w*/]+\.png", cells[0]) if cells else []
        if names:
            yield [path for name in names for path in sorted(folder.glob(name))], cells[1], cells[2]


def figure(picture: str, shown: Shown | None, made_by: str) -> list[str]:
    """Return a picture with its caption; a click opens it alone."""
    lines = [f"```{{figure}} {picture}", f":target: {picture}"]
    if shown is None:
        return [*lines, f":alt: {picture}", "", made_by, "```", ""]
    page = os.path.relpath(shown.page, posixpath.dirname(GALLERY)).replace(os.sep, "/")
    lines += [
        f":alt: {shown.caption}",
        "",
        f"{shown.caption}. [{shown.title}]({page})",
        "",
        made_by,
        "```",
        "",
    ]
    return lines


def show_pictures(app: Sphinx, docname: str, source: list[str]) -> None:
    """Put the pictures in the place of the list."""
    if docname != GALLERY:
        return
    root = Path(app.srcdir)
    folder = root / posixpath.dirname(GALLERY)
    shown = pictures_in_pages(root)
    lines = [source[0][: source[0].index("\n| picture")], "", "```````{container} gallery", ""]
    for pictures, made_by, more in rows(source[0], folder):
        by = f"{made_by}, {more}" if more else made_by
        for picture in pictures:
            name = picture.relative_to(folder).as_posix()
            lines += figure(name, shown.get(picture.relative_to(root).as_posix()), by)
    source[0] = "\n".join([*lines, "```````", ""])


def setup(app: Sphinx) -> dict[str, Any]:
    """Connect the gallery to Sphinx."""
    app.connect("source-read", show_pictures)
    return {"parallel_read_safe": True}
