"""`make app-demo`: a user in headless Chromium finds the hidden effect, from an empty page to a saved study."""

from __future__ import annotations

import contextlib
import os
import random
import re
import shutil
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from pliant import api

playwright = pytest.importorskip("playwright.sync_api", reason="pip install playwright")
CHROMIUM = shutil.which("chromium")
PICTURES = Path("runs/app-demo")
QUIET = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
LONG = 300_000  # ms; laws are compiled at the first use

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed: apt-get install chromium"),
]


def free_port() -> int:
    """Return a free port that no page of another test (8642 and above) and no outgoing connection takes meanwhile."""
    for port in random.Random(os.getpid()).sample(range(20_000, 32_000), 20):
        with socket.socket() as tried, contextlib.suppress(OSError):
            tried.bind(("127.0.0.1", port))
            return port
    raise AssertionError("no free port")


def started(folder: Path, store: Path, *options: str) -> tuple[subprocess.Popen[str], str]:
    """Start a server on a session and return it with its address."""
    command = [
        sys.executable,
        "-m",
        "pliant",
        "app",
        "--no-browser",
        "--out",
        str(folder),
        "--store",
        str(store),
        *options,
    ]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert server.stdout is not None
    for line in server.stdout:
        if found := re.search(r"http://\S+", line):
            return server, found[0]
    raise AssertionError("the server did not start")


@pytest.fixture
def browser() -> Iterator[Any]:
    with playwright.sync_playwright() as driver:
        made = driver.chromium.launch(executable_path=CHROMIUM, args=QUIET)
        yield made
        made.close()


def test_a_user_finds_the_hidden_effect(tmp_path: Path, browser: Any) -> None:
    PICTURES.mkdir(parents=True, exist_ok=True)
    session, store = tmp_path / "session", tmp_path / "store"
    server, address = started(session, store, "--port", str(free_port()))
    problems: list[str] = []
    try:
        page = browser.new_page(viewport={"width": 1500, "height": 1150})
        page.on("pageerror", lambda error: problems.append(str(error)))
        page.goto(address)
        page.click("#example", timeout=LONG)
        page.wait_for_selector("body[data-ready]", timeout=LONG)
        page.screenshot(path=PICTURES / "1-where.png")

        box = page.locator("#residual .u-over").bounding_box()
        page.mouse.move(box["x"] + 5, box["y"] + 10)
        page.mouse.down()
        page.mouse.move(box["x"] + 0.45 * box["width"], box["y"] + box["height"] - 10, steps=4)
        page.mouse.up()
        marked = page.text_content("#brushed")
        assert re.match(r"marked: \d+ % of the readings, \d+ % of the squared error", marked), marked
        page.screenshot(path=PICTURES / "2-marked.png")

        page.check("#effect-viscoelastic")
        page.wait_for_selector("#slider-viscoelastic-share", timeout=LONG)
        page.click("#fit")
        page.wait_for_selector(".fitted", timeout=LONG)
        now = page.text_content("#history li.now")
        aside = float(re.search(r"([\d.]+) on runs held out", now)[1])
        assert aside < 1.2, now
        page.screenshot(path=PICTURES / "3-fitted.png", full_page=True)

        server.kill()  # a restarted server continues in the same tab
        server.wait()
        server, again = started(session, store)
        assert again == address
        page.reload()
        page.wait_for_selector(".fitted", timeout=LONG)
        assert page.text_content("#history li.now") == now

        page.click("#undo")
        page.wait_for_selector("#history li.undone", timeout=LONG)
        page.click("#redo")
        page.wait_for_selector("#history li.now:last-child", timeout=LONG)
        page.click("#save")
        page.wait_for_selector("#dialog[open]", timeout=LONG)
        page.screenshot(path=PICTURES / "4-saved.png")
        saved = next((session / "saved").glob("*.yaml"))
        assert api.compare(api.open_study(saved, store=store)).rmse_over_floor < 1.2
        page.click("#dialog button")

        report = browser.new_page()  # its scripts run in an origin without access to the page or its token
        report.on("console", lambda said: problems.append(said.text) if said.type == "error" else None)
        report.goto(address.replace("/?", "/report?"))
        report.wait_for_selector("figure.live .panel .u-over", timeout=LONG)
        assert report.evaluate("origin") == "null"
        report.close()

        page.select_option("#keep", "page")
        page.wait_for_selector("#dialog[open]", timeout=LONG)
        assert next((session / "saved").glob("*.html")).stat().st_size < 3e6
        page.close()
    finally:
        server.send_signal(signal.SIGINT)
        said, _ = server.communicate(timeout=60)
    assert "everything is saved" in said
    assert server.returncode == 0
    assert not problems
