"""A scripted user of the evidence page in headless Chromium: drops files, looks, diagnoses, ticks, fits, saves."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.app.test_in_the_browser import CHROMIUM, LONG, QUIET, playwright, started

MOST_ROUNDS = 3  # diagnoses that lead to a tick
POLL = 100  # ms between two questions
FALLS = 0.99  # of the left-out error: a user wants it below


EMPTY, READY = "#begin:visible", "body[data-ready]"


@contextmanager
def opened(folder: Path, store: Path, until: str = EMPTY) -> Iterator[tuple[Any, int]]:
    """The page of a session in a browser of its own, when the selector stands, and the server's process."""
    server, address = started(folder, store)
    try:
        with playwright.sync_playwright() as driver:
            browser = driver.chromium.launch(executable_path=CHROMIUM, args=QUIET)
            page = browser.new_page(viewport={"width": 1500, "height": 1150})
            page.goto(address)
            page.wait_for_selector(until, timeout=LONG)
            yield page, server.pid
            browser.close()
    finally:
        server.terminate()
        server.wait()


@dataclass
class PageUser:
    """What a user can do with a page that is open; everything goes through what is on the screen."""

    page: Any

    def drop(self, files: Sequence[Path]) -> float:
        """Drop files; returns the seconds until pictures stand."""
        began = time.perf_counter()
        self.page.set_input_files("#files", [str(file) for file in files])
        self.page.wait_for_selector("#time canvas", timeout=LONG)
        shown = time.perf_counter() - began
        self.settled()
        return shown

    def until(self, holds: str) -> None:
        """Ask the page until an expression holds; its policy lets no text be run as a script from within."""
        for _ in range(LONG // POLL):
            if self.page.evaluate(f"Boolean({holds})"):
                return
            self.page.wait_for_timeout(POLL)
        raise TimeoutError(holds)

    def settled(self) -> None:
        """Wait until the page shows the server's present state, effects screened."""
        self.until("document.body.dataset.ready === String(version) && document.querySelector('#job').hidden")

    def look(self) -> str:
        """Where the model fails, in the page's words."""
        return str(self.page.text_content("#sentence"))

    def diagnose(self) -> tuple[str, ...]:
        """Diagnose; the kinds of the most probable explanation that is in the list and leaves less error; else none."""
        before = self.page.evaluate("version")
        self.page.click("#diagnose")
        self.until(f"version > {before} && view.model.diagnosis")
        self.settled()
        best = self.page.evaluate("view.model.diagnosis.hypotheses[0]")
        said = self.page.text_content("#verdict table tr:nth-child(2) td")
        assert said.replace(" ", "_") == ("_+_".join(best["kinds"]) or "nothing_is_missing"), said
        listed = self.page.evaluate("view.model.catalogue.map(one => one.kind)")
        worth = best["left_out"] < FALLS * self.page.evaluate("view.model.diagnosis.nothing")
        return tuple(best["kinds"]) if worth and set(best["kinds"]) <= set(listed) else ()

    def tick(self, kind: str) -> None:
        """Tick an effect that is not ticked."""
        more = self.page.locator("#effects details.more:not([open]) summary")
        if more.count():
            more.first.click()
        self.page.check(f"#effect-{kind}")
        self.until(f"view.model.effects.some(one => one.kind === '{kind}')")
        self.settled()

    def fit(self) -> None:
        """Fit what is ticked."""
        steps = self.page.locator("#history li").count()
        self.page.click("#fit")
        self.until(
            f"document.querySelectorAll('#history li').length > {steps} || !document.querySelector('#said').hidden"
        )
        self.settled()

    def improve_by_hand(self) -> tuple[str, ...]:
        """Diagnose, tick what is probable, fit; again until nothing more is. Returns what was ticked."""
        ticked: list[str] = []
        for _ in range(MOST_ROUNDS):
            found = [kind for kind in self.diagnose() if kind not in ticked]
            if not found:
                break
            for kind in found:
                self.tick(kind)
            self.fit()
            ticked += found
        return tuple(ticked)

    def improve(self) -> None:
        """`pliant improve`, by its button."""
        before = self.page.evaluate("version")
        self.page.click("#improve")
        self.until(
            f"version > {before} && document.querySelector('#job').hidden && "
            "(view.model.steps.some(s => s.words.startsWith('improved')) || !document.querySelector('#said').hidden)"
        )
        self.settled()

    def save(self) -> Path:
        """Save the study; returns its file."""
        self.page.click("#save")
        self.page.wait_for_selector("#dialog[open]", timeout=LONG)
        path = Path(self.page.text_content("#dialogtext").splitlines()[0])
        self.page.click("#dialog button")
        return path

    def go_back(self, step: int) -> None:
        """Look at a step of the history, from 0."""
        self.page.click(f"#history li:nth-child({step + 1}) button")
        self.until(f"view.model.cursor === {step}")
        self.settled()

    def warnings(self) -> list[str]:
        """What the page doubts."""
        return list(self.page.locator("#warnings .warning").all_text_contents())

    def false_kind(self, right: Sequence[str]) -> str:
        """An effect that these runs could show, told apart from all that are ticked, and improbable."""
        return str(
            self.page.evaluate(
                """right => { const kinds = screening.found.kinds, d = view.model.diagnosis || {by_kind: {}};
                const no = new Set([...right, ...view.model.effects.map(e => e.kind)]);
                const free = view.model.catalogue.map(c => c.kind).filter(k => kinds[k] && kinds[k].shown && !no.has(k)
                  && !kinds[k].alike.some(other => no.has(other)));
                return free.sort((a, b) => (d.by_kind[a] || 0) - (d.by_kind[b] || 0))[0] || ""; }""",
                list(right),
            )
        )
