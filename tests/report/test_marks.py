"""Every mark of a chart is drawn in the still and on the page; scales, ends and helpers give what they state."""

from __future__ import annotations

import io
import re
from importlib.resources import files
from typing import Any

import numpy as np
import pytest
from PIL import Image
from tests.app.test_in_the_browser import CHROMIUM, QUIET, playwright

from pliant.report.chart import (
    Band,
    Chart,
    ChartAxis,
    ChartBars,
    ChartCells,
    ChartLine,
    ChartNote,
    ChartRule,
    Mark,
    Panel,
    one_height,
    spread_labels,
    staircase,
    strokes,
)
from pliant.report.chart_colours import ColourScale
from pliant.report.chart_json import KINDS
from pliant.report.document import Document, Picture, drawn
from pliant.report.render import page
from pliant.report.still import still

X = np.linspace(0.0, 1.0, 5)
SCALE = ColourScale.even("error", "%", (0.0, 1.0), ("#ff0000", "#0000ff"))
GREEN = "#00aa00"
MARKS: dict[str, Mark] = {
    "line": ChartLine("a", X, X, "", GREEN, 3.0),
    "dots": ChartLine("a", X, X, "", GREEN, 0.0, 9.0, "D"),
    "filled": ChartLine("a", X, X**2, "", "#000000", fill=GREEN),
    "rim": ChartLine("a", X, np.full(5, 0.5), "", GREEN, 4.0, rim=True),
    "band": Band("a", X, 0 * X, X, colour=GREEN),
    "bars": ChartBars("a", X, 0 * X, X, colour=GREEN, thick=0.1, upright=True),
    "rule": ChartRule(0.5, GREEN, 4.0),
    "note": ChartNote("███", 0.5, 0.5, colour=GREEN),
}


def chart(mark: Mark) -> Chart:
    frame = ChartLine("frame", X, X, "", "#000000", 0.1)
    return Chart((Panel(ChartAxis("x", "mm"), ChartAxis("y", "%"), (frame, mark)),), legend=())


def pixels(png: Any) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(png.tobytes())).convert("RGB"), int)


@pytest.mark.parametrize("name", MARKS)
def test_the_still_has_the_mark_colour(name: str) -> None:
    own = np.abs(pixels(still(chart(MARKS[name]))) - [0, 0xAA, 0]).sum(axis=2) < 12
    assert own.sum() > 50
    assert not np.any(np.abs(pixels(still(chart(ChartNote("", 0, 0)))) - [0, 0xAA, 0]).sum(axis=2) < 12)


def test_cells_and_dots_have_the_colours_for_their_values() -> None:
    cells = ChartCells("error", np.arange(3.0), np.arange(2.0), np.array([[0.0, 1.0]]))
    dots = ChartLine("dots", np.array([0.5]), np.array([0.5]), "", dot=30.0, values=np.array([1.0]))
    axis = ChartAxis("x")
    for marks, colours in (((cells,), ([255, 0, 0], [0, 0, 255])), ((dots,), ([0, 0, 255],))):
        shown = pixels(still(Chart((Panel(axis, axis, marks, scale=SCALE),))))
        for colour in colours:
            assert (np.abs(shown[:, : shown.shape[1] // 2 + 150] - colour).sum(axis=2) < 20).sum() > 500


def test_the_page_has_a_drawer_for_every_mark() -> None:
    code = (files("pliant.report") / "templates" / "chart.js").read_text("utf-8")
    table = code[code.index("const DRAW = {") : code.index("function fillOutside")]
    assert set(re.findall(r"^    (\w+)\(c, m", table, flags=re.MULTILINE)) == set(KINDS.values())


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed: apt-get install chromium")
def test_the_page_has_every_mark_colour(tmp_path: Any) -> None:
    small = np.geomspace(1e-9, 1e-2, 5)
    log = ChartAxis("log", ends=(1e-10, 1e-1), log=True)
    charts = {name: chart(mark) for name, mark in MARKS.items()}
    charts["decades"] = Chart((Panel(log, log, (ChartLine("a", small, small, "", GREEN, 3.0),)),))
    shown = [Picture(name, f"a mark: {name}", one) for name, one in charts.items()]
    for one in shown:
        made = page(Document("k", "t", "s", draw=lambda one=one: drawn(one)))
        (tmp_path / f"{one.name}.html").write_text(made.html, "utf-8")
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=QUIET)
        for name in charts:
            opened = browser.new_page()
            opened.goto((tmp_path / f"{name}.html").as_uri())
            opened.wait_for_selector("figure.live .panel .u-over")
            seen = pixels(np.frombuffer(opened.locator(".panel").screenshot(), np.uint8))
            assert (np.abs(seen - [0, 0xAA, 0]).sum(axis=2) < 12).sum() > 30, name
            opened.close()
        browser.close()


def test_a_scale_has_its_colours_at_its_values_and_mixes_between_them() -> None:
    assert SCALE.to_hex(np.array([0.0, 0.5, 1.0, 7.0])) == ["#ff0000", "#800080", "#0000ff", "#0000ff"]
    decades = ColourScale.decades("error", "%", (0.02, 3.0), ("#000000", "#ffffff"))
    assert decades.at == pytest.approx((0.01, 10.0)) and decades.log
    assert decades.to_hex(np.array([10**-0.5])) == ["#808080"]
    same = ColourScale.even("load", "", (2.0, 2.0), ("#000000", "#ffffff"))
    assert same.at[1] > same.at[0]


def test_panels_with_one_height_have_all_their_values_but_no_height_shares() -> None:
    axis = ChartAxis("x")
    rim = ChartLine("rim", X, X, rim=True)
    panels = [Panel(axis, axis, (ChartLine("a", X, k + 10 * X, ""), rim)) for k in (5.0, 20.0)]
    ends = [panel.y.ends for panel in one_height(panels)]
    assert ends[0] == ends[1] == pytest.approx((3.5, 31.5))
    first, _ = one_height(panels, every=2)
    assert first.y.ends == pytest.approx((4.4, 15.6))


def test_labels_are_moved_apart_by_no_more_than_needed() -> None:
    assert spread_labels([0.0, 5.0, 9.0], 1.0) == pytest.approx([0.0, 5.0, 9.0])
    moved = spread_labels([2.0, 1.0, 1.1], 1.0)
    assert np.diff(np.sort(moved)).min() == pytest.approx(1.0)
    assert np.argsort(moved).tolist() == [1, 2, 0]
    assert spread_labels([0.0, 0.1], 1.0, floor=0.0).min() == 0.0


def test_stairs_and_strokes_pass_through_their_values() -> None:
    x, y = staircase(np.arange(4.0), np.array([3.0, 3.0, 1.0, 1.0]))
    assert x.tolist() == [0.0, 2.0, 2.0, 3.0, 3.0] and y.tolist() == [3.0, 3.0, 1.0, 1.0, 1.0]
    x, y = strokes(np.array([1.0, 2.0]), np.zeros(2), np.ones(2))
    assert np.array_equal(x[[0, 1, 3, 4]], [1, 1, 2, 2]) and np.isnan(x[2]) and y[:2].tolist() == [0.0, 1.0]
