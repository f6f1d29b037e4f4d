"""A page's interactive charts and tables in headless Chromium; and without scripts, printed, and at a phone's width."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tests.app.test_in_the_browser import CHROMIUM, QUIET, playwright
from tests.evidence.compare_data import bench, falling_shift

from pliant.evidence.comparison import compare
from pliant.report.comparison import comparison_document
from pliant.report.render import page as page_of

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed: apt-get install chromium"),
]
HOSTILE = "</script><script>hit=1</script><img src=x onerror=hit=1>"
RUNS = "figure[data-chart=runs]"
Opened = Callable[..., Any]


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Return a comparison's page whose first run has a hostile name."""
    measurement, predicted = bench(0, effect=falling_shift(0.02), settings=[(5e3, 0.0), (5e3, 1e-3)], dt=0.2)
    first = measurement.runs[0]
    runs = (replace(first, history=replace(first.history, run=HOSTILE)), *measurement.runs[1:])
    measurement = replace(measurement, runs=runs)
    made = page_of(comparison_document("finger", measurement, predicted, compare(measurement, predicted)))
    file = tmp_path_factory.mktemp("moving") / "report.html"
    file.write_text(made.html, "utf-8")
    assert len(made.html) < 3e6
    return file.as_uri()


@pytest.fixture(scope="module")
def opened(address: str) -> Iterator[Opened]:
    """Yield a function that opens the page in a new context; script errors and network requests fail the test."""
    wrong: list[str] = []
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=QUIET)

        def make(width: int = 1200, **settings: Any) -> Any:
            page = browser.new_context(viewport={"width": width, "height": 900}, **settings).new_page()
            page.on("pageerror", lambda error: wrong.append(str(error)))
            page.on(
                "request", lambda asked: wrong.append(asked.url) if asked.url.startswith("http") else None
            )
            page.goto(address)
            return page

        yield make
        browser.close()
    assert not wrong


def view(page: Any, panel: int = 0) -> list[float]:
    return [
        float(end) for end in page.locator(f"{RUNS} .panel").nth(panel).get_attribute("data-view").split()
    ]


def test_a_dragged_box_is_zoomed_to_and_the_error_below_follows(opened: Opened) -> None:
    page = opened()
    page.wait_for_selector(f"{RUNS}.live .panel .u-over")
    before = view(page)
    page.locator(f"{RUNS} .u-over").first.scroll_into_view_if_needed()
    box = page.locator(f"{RUNS} .u-over").first.bounding_box()
    page.mouse.move(box["x"] + 0.25 * box["width"], box["y"] + 0.3 * box["height"])
    page.mouse.down()
    page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 0.8 * box["height"], steps=4)
    page.mouse.up()
    zoomed, span = view(page), before[1] - before[0]
    expected = [before[0] + 0.25 * span, before[0] + 0.5 * span]
    assert zoomed[:2] == pytest.approx(expected, abs=0.02 * span)
    assert zoomed[3] - zoomed[2] < 0.6 * (before[3] - before[2])
    assert view(page, 1)[:2] == pytest.approx(zoomed[:2])
    page.locator(f"{RUNS} .panel").first.press("0")  # the keyboard shows all again
    assert view(page) == before and view(page, 1)[:2] == pytest.approx(before[:2])


def test_the_pointer_reads_values_with_units_and_names_stay_text(opened: Opened) -> None:
    page = opened()
    over = page.locator(f"{RUNS} .u-over").first
    over.wait_for()
    over.scroll_into_view_if_needed()
    for share in np.linspace(0.1, 0.9, 17):
        box = over.bounding_box()
        page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + share * box["height"])
        if page.locator(f"{RUNS} .tip:visible").count():
            break
    said = page.locator(f"{RUNS} .tip:visible").text_content()
    assert "°" in said and "time in the run" in said and said.endswith(" s")
    assert HOSTILE in page.locator(f"{RUNS} .switches").first.text_content()
    assert page.evaluate("typeof hit") == "undefined" and page.locator("img[src=x]").count() == 0


def test_a_run_is_switched_off_and_on(opened: Opened) -> None:
    page = opened()
    page.wait_for_selector(f"{RUNS}.live .panel")
    cells = page.locator(f"{RUNS} .cell:visible")
    count = cells.count()
    page.locator(f"{RUNS} .switches summary").first.click()
    box = page.get_by_label(HOSTILE).first
    box.uncheck()
    assert cells.count() == count - 1
    assert page.locator(f"{RUNS} .cell:visible .head", has_text=HOSTILE).count() == 0
    box.check()
    assert cells.count() == count


def test_a_table_is_sorted_by_its_numbers(opened: Opened) -> None:
    page = opened()
    page.evaluate("document.querySelectorAll('details').forEach(part => { part.open = true; })")
    table = page.locator("h3:has-text('Run by run') + .scroll table")
    head = table.locator("th", has_text="rms").first
    column = page.evaluate("head => head.cellIndex", head.element_handle())
    cells = table.locator(f"tbody td:nth-child({column + 1})")
    before = [float(text) for text in cells.all_text_contents()]
    head.get_by_role("button").click()
    assert head.get_attribute("aria-sort") == "ascending"
    assert [float(text) for text in cells.all_text_contents()] == sorted(before)
    head.get_by_role("button").press("Enter")
    assert (
        [float(text) for text in cells.all_text_contents()] == sorted(before, reverse=True) != sorted(before)
    )


def test_without_scripts_and_on_paper_the_still_picture_stands(opened: Opened) -> None:
    without = opened(java_script_enabled=False)
    assert without.locator(f"{RUNS} img").is_visible()
    printed = opened()
    printed.wait_for_selector(f"{RUNS}.live .panel")
    assert not printed.locator(f"{RUNS} img").is_visible()
    printed.emulate_media(media="print")
    assert printed.locator(f"{RUNS} img").is_visible() and not printed.locator(f"{RUNS} .chart").is_visible()


def test_a_phone_scrolls_in_one_direction_only(opened: Opened) -> None:
    page = opened(width=390)
    page.wait_for_selector(f"{RUNS}.live .panel .u-over")
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    assert page.locator(f"{RUNS} .u-over").first.bounding_box()["width"] < 390
