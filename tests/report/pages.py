"""Pages as tests read them: matching tags, no external references, valid pictures, plain text."""

from __future__ import annotations

import base64
import json
import re
import struct
from html import unescape
from html.parser import HTMLParser

import numpy as np

from pliant.report.document import Page
from pliant.report.render import moving

VOID = {"meta", "img", "br", "link", "hr", "input"}


class _Tags(HTMLParser):
    """A parser that collects tags and attributes, and rejects tags that do not match."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.attributes: list[tuple[str, str]] = []
        self.tags: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.attributes += [(name, value or "") for name, value in attrs]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def words(html: str) -> str:
    """Return the page's text."""
    text = re.sub(r"<(style|script)\b.*?</\1>", "", html, flags=re.DOTALL)
    return unescape(re.sub(r"<[^>]+>", " ", text)).replace("\u00a0", " ")


def check_sound(page: Page) -> str:
    """Check that a page parses, is self-contained and small, and embeds valid PNG files with words; return its text."""
    parsed = _Tags()
    parsed.feed(page.html)
    parsed.close()
    assert not parsed.open
    for name, value in parsed.attributes:
        if name in ("src", "href"):
            assert value.startswith(("data:image/png;base64,", "#")), value[:60]
        assert name != "alt" or len(value) > 20
    ours = {*moving(True).code, *moving(False).code}
    for kind, code in re.findall(r"<script([^>]*)>(.*?)</script>", page.html, flags=re.DOTALL):
        assert (kind == ' type="application/json"' and json.loads(code)) or (kind == "" and code in ours)
    assert "url(" not in page.html
    assert len(page.html) < 2_000_000
    for picture in page.pictures.values():
        data = picture.tobytes()
        assert picture.dtype == np.uint8 and data.startswith(b"\x89PNG\r\n\x1a\n")
        width, height = struct.unpack(">II", data[16:24])
        assert 400 <= width <= 2600 and 300 <= height <= 1800
        assert base64.b64encode(data).decode() in page.html
    text = words(page.html)
    for bad in ("nan", "None", "Undefined"):
        assert not re.search(rf"\b{bad}\b", text), bad
    return text
