"""The page in headless Chromium: two tabs, a reload and a kill during a computation, wrong files, keys, a phone."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from .conftest import STUDY, recording
from .page_user import PageUser, opened
from .test_in_the_browser import CHROMIUM, LONG, QUIET, playwright, started

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed: apt-get install chromium"),
]
DONE = "#history li.now"


@pytest.fixture
def files(tmp_path: Path) -> list[Path]:
    """Return a recording and its study."""
    found = [tmp_path / "bench.csv", tmp_path / "bend.yaml"]
    for file, text in zip(found, (recording(), STUDY), strict=True):
        file.write_text(text)
    return found


@pytest.fixture
def user(tmp_path: Path) -> Iterator[PageUser]:
    """Yield a user on an empty page."""
    with opened(tmp_path / "session", tmp_path / "store") as (page, _):
        yield PageUser(page)


def test_two_tabs_show_one_session_and_a_reload_in_a_fit_loses_nothing(
    tmp_path: Path, files: list[Path], user: PageUser
) -> None:
    user.drop(files)
    other = PageUser(user.page.context.browser.new_context().new_page())
    other.page.goto(user.page.url)
    other.settled()
    user.tick("actuation_gain")
    other.until("view.model.effects.some(one => one.kind === 'actuation_gain')")
    steps = user.page.locator("#history li").count()
    user.page.click("#fit")
    user.page.reload()
    for one in (user, other):
        one.until(f"document.querySelectorAll('#history li').length === {steps + 1}")
        one.settled()
    assert user.page.text_content(DONE) == other.page.text_content(DONE)
    results = tmp_path / "session" / "results"
    before = {file: file.stat().st_mtime_ns for file in results.glob("fit*")}
    assert len([file for file in before if file.suffix == ".json"]) == 1
    other.page.click("#fit")  # the file is already loaded
    other.page.wait_for_timeout(1500)
    other.settled()
    assert {file: file.stat().st_mtime_ns for file in results.glob("fit*")} == before


def test_quick_clicks_on_runs_are_all_kept_and_pictures_show_what_is_there(
    files: list[Path], user: PageUser
) -> None:
    user.drop(files)
    page = user.page
    names = page.evaluate("data.runs.filter(run => !run.aside).map(run => run.name)")[:3]
    for name in names:
        page.locator(f"#runs input[aria-label='run {name}']").click(no_wait_after=True)
    user.until(f"view.model.off.length === {len(names)}")
    user.settled()
    assert set(page.evaluate("view.model.off")) == set(names)
    boxes = page.evaluate("[...document.querySelectorAll('#runs input')].map(one => one.checked)")
    assert boxes == page.evaluate("data.runs.map(run => !run.off)")
    page.click("#undo")
    user.until(f"view.model.off.length === {len(names) - 1}")
    page.check("#seeaside")
    user.settled()
    for name in ("time", "residual"):  # every displayed reading is within the axes
        assert page.evaluate(
            "name => { const {shown: s, view: v} = pictures[name]; return s.x.every((x, k) => "
            "!s.on[k] || x === null || s.y[k] === null || "
            "(x >= v.x[0] && x <= v.x[1] && s.y[k] >= v.y[0] && s.y[k] <= v.y[1])); }",
            name,
        ), name


def test_a_recording_that_is_added_goes_beside_the_others(
    tmp_path: Path, files: list[Path], user: PageUser
) -> None:
    user.drop(files)
    user.tick("actuation_gain")
    lines = recording(seed=4).splitlines()
    more = tmp_path / "more.csv"
    more.write_text("\n".join([lines[0], *(f"s{line[1:]}" for line in lines[1:])]) + "\n")
    user.page.set_input_files("#files", str(more))
    user.page.wait_for_selector("#said:has-text('are one measurement now')", timeout=LONG)
    user.settled()
    assert user.page.evaluate("data.runs.length") == 12
    assert user.page.evaluate("view.model.effects[0].kind") == "actuation_gain"
    user.page.click("#undo")
    user.until("data.runs.length === 6")


def test_work_that_a_kill_cut_off_is_done_after_a_restart_in_the_same_tab(
    tmp_path: Path, files: list[Path]
) -> None:
    session, store = tmp_path / "session", tmp_path / "store"
    server, address = started(session, store)
    try:
        with playwright.sync_playwright() as driver:
            page = driver.chromium.launch(executable_path=CHROMIUM, args=QUIET).new_page()
            page.goto(address)
            page.wait_for_selector("#begin:visible", timeout=LONG)
            user = PageUser(page)
            user.drop(files)
            page.click("#diagnose")
            page.wait_for_selector("#job:visible", timeout=LONG)
            server.kill()
            server.wait()
            page.wait_for_selector("#said:has-text('The server does not answer')", timeout=LONG)
            server, again = started(session, store)
            assert again == address
            user.until("view.model.diagnosis && document.querySelector('#said').hidden")
            best = page.evaluate("view.model.diagnosis.hypotheses[0]")
            assert best["left_out"] < 0.5 * page.evaluate("view.model.diagnosis.nothing"), best
    finally:
        server.terminate()
        server.wait()


def test_wrong_files_are_told_left_out_and_in_nobodys_way(tmp_path: Path, user: PageUser) -> None:
    page = user.page
    wrong = {
        "photo.jpg": b"\xff\xd8\xff" + bytes(range(256)),
        "empty.csv": b"",
        "other.csv": b"name,kg\nanna,3\n",
    }
    wrong["typo.yaml"] = b"pliant: 1\nname: x\nsurogate: {kind: polynomial}\n"
    for name, content in wrong.items():
        (tmp_path / name).write_bytes(content)
    for name, place, words in (
        ("photo.jpg", "#said", "neither a recording"),
        ("empty.csv", "#said", "is empty"),
        ("other.csv", "#recording", "no column drives the chain"),
        ("typo.yaml", "#recording", "did you mean 'surrogate'?"),
    ):
        page.set_input_files("#files", [str(tmp_path / name)])
        page.wait_for_selector(f'{place}:has-text("{words}")', timeout=LONG)
    page.get_by_role("button", name="Leave it out").click()
    user.until("view.data.length === 0")
    page.set_input_files("#files", [str(tmp_path / "other.csv")])
    user.until("view.data.length === 1")
    page.get_by_role("button", name="Open the example").press("Enter")
    page.wait_for_selector("#time canvas", timeout=LONG)


def test_by_keys_alone_the_robot_stands_in_space_and_a_phone_shows_all(
    files: list[Path], user: PageUser
) -> None:
    page = user.page
    user.drop(files)
    page.locator("#space summary").press("Enter")
    page.wait_for_selector("#robotview .space[data-drawn]", timeout=LONG)
    first = page.locator("#robotview .space").get_attribute("data-drawn")
    page.get_by_role("img", name="The robot through the run").press("ArrowRight")
    user.until(f"document.querySelector('#robotview .space').dataset.drawn !== {first!r}")
    turned = page.evaluate("Array.from(document.querySelector('#robotview').scene.turned)")
    before = page.evaluate("document.querySelector('#robotview').scene.data.colourings[0].limits[1]")
    page.locator("#effect-actuation_gain").press("Space")
    user.until("view.model.effects.length === 1")
    user.settled()
    assert page.evaluate("Array.from(document.querySelector('#robotview').scene.turned)") == turned
    assert page.evaluate("document.querySelector('#robotview').scene.data.colourings[0].limits[1]") != before
    page.set_viewport_size({"width": 390, "height": 800})
    page.wait_for_timeout(500)
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
