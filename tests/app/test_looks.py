"""Contrast of the page's colours by WCAG 2.2's ratio of luminances: 4.5 for text, 3 for marks and controls."""

from __future__ import annotations

import re
from importlib import resources

STATIC = resources.files("pliant_app") / "static"
TEXT, MARK = 4.5, 3.0


def contrast(one: str, other: str) -> float:
    """Return the contrast ratio of WCAG 2.2, 1.4.3: (lighter + 0.05) / (darker + 0.05) of relative luminances."""

    def luminance(colour: str) -> float:
        parts = [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
        linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts]
        return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]

    dark, light = sorted([luminance(one), luminance(other)])
    return (light + 0.05) / (dark + 0.05)


def test_page_colours_stand_out() -> None:
    css, js = ((STATIC / name).read_text("utf-8") for name in ("page.css", "pictures.js"))
    named = dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6})", css))
    drawn = dict(re.findall(r'([A-Z]+) = "(#[0-9a-f]{6})"', js))
    assert contrast("#ffffff", "#000000") == 21.0
    papers = (named["paper"], named["card"])
    for text in (named["ink"], named["soft"], named["warn-line"]):
        assert min(contrast(text, paper) for paper in papers) >= TEXT
    assert contrast(named["warn-line"], named["warn"]) >= TEXT
    assert contrast(named["paper"], named["model"]) >= TEXT  # of the filled button
    for mark in (
        named["edge"],
        named["plain"],
        named["mark"],
        *(drawn[k] for k in ("MODEL", "PLAIN", "MARK")),
    ):
        assert contrast(mark, named["paper"]) >= MARK
    for mark in (drawn["INK"], drawn["FAINT"], drawn["MARK"]):  # readings on the noise band
        assert contrast(mark, drawn["BAND"]) >= MARK
    assert "opacity" not in re.sub(
        r"[^}]*(?:input|\.bar) \{[^}]*\}", "", css
    )  # antialiasing makes thin text paler than its stated colour
