"""A scripted user of the evidence page in headless Chromium: drops files, diagnoses, selects effects, fits, saves."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.app.test_in_the_browser import CHROMIUM, LONG, QUIET, playwright, started

MOST_ROUNDS = 3  # diagnoses until an effect is selected
POLL = 100  # ms between two polls
FALLS = 0.99  # share of the left-out error below which a user accepts a change


EMPTY, READY = "#begin:visible", "body[data-ready]"


@contextmanager
def opened(folder: Path, store: Path, until: str = EMPTY) -> Iterator[tuple[Any, int]]:
    """Yield a session's page in its own browser, once the selector `until` is present, and the server's process id."""
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
    """The actions of a user on an open page, all performed through the elements on the screen."""

    page: Any

    def drop(self, files: Sequence[Path]) -> float:
        """Drop files and return the seconds until the pictures are shown."""
        began = time.perf_counter()
        self.page.set_input_files("#files", [str(file) for file in files])
        self.page.wait_for_selector("#time canvas", timeout=LONG)
        shown = time.perf_counter() - began
        self.settled()
        return shown

    def until(self, holds: str) -> None:
        """Poll the page until an expression is true; its security policy forbids evaluating text as a script there."""
        for _ in range(LONG // POLL):
            if self.page.evaluate(f"Boolean({holds})"):
                return
            self.page.wait_for_timeout(POLL)
        raise TimeoutError(holds)

    def settled(self) -> None:
        """Wait until the page shows the server's present state, effects screened."""
        self.until("document.body.dataset.ready === String(version) && document.querySelector('#job').hidden")

    def look(self) -> str:
        """Return the page's sentence on where the model fails."""
        return str(self.page.text_content("#sentence"))

    def diagnose(self) -> tuple[str, ...]:
        """Diagnose and return the kinds of the most probable listed explanation that leaves less error, or nothing."""
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
        """Select an effect that is not selected."""
        more = self.page.locator("#effects details.more:not([open]) summary")
        if more.count():
            more.first.click()
        self.page.check(f"#effect-{kind}")
        self.until(f"view.model.effects.some(one => one.kind === '{kind}')")
        self.settled()

    def fit(self) -> None:
        """Fit the selected effects."""
        steps = self.page.locator("#history li").count()
        self.page.click("#fit")
        self.until(
            f"document.querySelectorAll('#history li').length > {steps} || !document.querySelector('#said').hidden"
        )
        self.settled()

    def improve_by_hand(self) -> tuple[str, ...]:
        """Diagnose, select the probable effects and fit until none is added; return the selected kinds."""
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
        """Run `pliant improve` by its button."""
        before = self.page.evaluate("version")
        self.page.click("#improve")
        self.until(
            f"version > {before} && document.querySelector('#job').hidden && "
            "(view.model.steps.some(s => s.words.startsWith('improved')) || !document.querySelector('#said').hidden)"
        )
        self.settled()

    def save(self) -> Path:
        """Save the study and return its file."""
        self.page.click("#save")
        self.page.wait_for_selector("#dialog[open]", timeout=LONG)
        path = Path(self.page.text_content("#dialogtext").splitlines()[0])
        self.page.click("#dialog button")
        return path

    def go_back(self, step: int) -> None:
        """Show a step of the history, counted from 0."""
        self.page.click(f"#history li:nth-child({step + 1}) button")
        self.until(f"view.model.cursor === {step}")
        self.settled()

    def warnings(self) -> list[str]:
        """Return the warnings that the page shows."""
        return list(self.page.locator("#warnings .warning").all_text_contents())

    def false_kind(self, right: Sequence[str]) -> str:
        """Return the least probable effect that these runs could show and distinguish from all selected ones."""
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
