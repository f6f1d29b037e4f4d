"""Chromium driven over a pipe by its own protocol, without recording, for figures of its memory.

A test driver keeps every request and console line of a page in the page's own process, which grows by that. Here no
domain is enabled: scripts are evaluated and the mouse is moved, as if a hand did it.
https://chromedevtools.github.io/devtools-protocol/
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

FLAGS = ("--headless=new", "--remote-debugging-pipe", "--window-size=1500,1150")
POLL_S, LONG_S = 0.1, 300.0
STILL = """async selector => { let was = "";
  for (;;) {
    const found = document.querySelector(selector); found.scrollIntoView({block: "center"});
    const b = found.getBoundingClientRect(), at = [b.x, b.y, b.width, b.height];
    if (String(at) === was) return at;
    was = String(at); await new Promise(done => setTimeout(done, 30));
  } }"""


class DevtoolsPage:
    """The one page of a browser."""

    def __init__(self, into: int, out: int) -> None:
        self._into, self._out = into, out
        self._asked, self._buffer = 0, b""
        self.events: list[dict[str, Any]] = []
        self._session: str | None = None
        (first, *_) = (
            one for one in self.browser("Target.getTargets")["targetInfos"] if one["type"] == "page"
        )
        self._session = self.browser("Target.attachToTarget", targetId=first["targetId"], flatten=True)[
            "sessionId"
        ]

    def browser(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Ask the browser."""
        return self._ask(method, parameters, None)

    def send(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Ask the page; events that come meanwhile are in `events`."""
        return self._ask(method, parameters, self._session)

    def _ask(self, method: str, parameters: Mapping[str, Any], session: str | None) -> dict[str, Any]:
        self._asked += 1
        whole = {"id": self._asked, "method": method, "params": parameters}
        os.write(self._into, json.dumps(whole | ({"sessionId": session} if session else {})).encode() + b"\0")
        while (answer := self._next()).get("id") != self._asked:
            self.events.append(answer)
        if "error" in answer:
            raise RuntimeError(f"{method}: {answer['error']['message']}")
        result: dict[str, Any] = answer["result"]
        return result

    def _next(self) -> dict[str, Any]:
        while b"\0" not in self._buffer:
            more = os.read(self._out, 1 << 20)
            if not more:
                raise RuntimeError("the browser has ended")
            self._buffer += more
        one, _, self._buffer = self._buffer.partition(b"\0")
        found: dict[str, Any] = json.loads(one)
        return found

    def evaluate(self, script: str) -> Any:
        """Return the value of an expression, awaited."""
        answer = self.send("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        if "exceptionDetails" in answer:
            raise RuntimeError(f"{script}: {answer['exceptionDetails']}")
        return answer["result"].get("value")

    def until(self, holds: str) -> None:
        """Poll until an expression is true."""
        end = time.monotonic() + LONG_S
        while not self.evaluate(f"Boolean({holds})"):
            if time.monotonic() > end:
                raise TimeoutError(holds)
            time.sleep(POLL_S)

    def box(self, selector: str) -> tuple[float, float, float, float]:
        """Return left, top, width, height of an element in view, once its position is constant."""
        left, top, width, height = self.evaluate(f"({STILL})({json.dumps(selector)})")
        return left, top, width, height

    def mouse(self, kind: str, x: float, y: float, held: bool) -> None:
        """Send mouseMoved, mousePressed or mouseReleased; the left button, if it is held or changes."""
        clicks = int(kind != "mouseMoved")
        button = "left" if held or clicks else "none"
        self.send(
            "Input.dispatchMouseEvent",
            type=kind,
            x=x,
            y=y,
            button=button,
            buttons=int(held),
            clickCount=clicks,
        )

    def click(self, selector: str) -> None:
        """Click an element in its middle."""
        left, top, width, height = self.box(selector)
        self.drag([(left + width / 2, top + height / 2)])

    def drag(self, way: Sequence[tuple[float, float]]) -> None:
        """Press at the first place, move over the others, release at the last."""
        self.mouse("mouseMoved", *way[0], held=False)
        self.mouse("mousePressed", *way[0], held=True)
        for place in way[1:]:
            self.mouse("mouseMoved", *place, held=True)
        self.mouse("mouseReleased", *way[-1], held=False)

    def give(self, selector: str, files: Sequence[Path]) -> None:
        """Choose files, as a dialog would."""
        found = self.send("Runtime.evaluate", expression=f"document.querySelector({json.dumps(selector)})")
        self.send(
            "DOM.setFileInputFiles", files=[str(one) for one in files], objectId=found["result"]["objectId"]
        )

    def process(self) -> int:
        """Return the process that renders the page: the largest of its kind."""
        listed = self.browser("SystemInfo.getProcessInfo")["processInfo"]
        return max(
            (int(one["id"]) for one in listed if one["type"] == "renderer"),
            key=lambda one: resident_mb(one)[0],
        )


def resident_mb(process: int) -> tuple[float, float]:
    """Return resident memory of a process, whole and without mapped files, MB."""
    lines = (line.split() for line in Path(f"/proc/{process}/status").read_text().splitlines())
    kb = {words[0]: float(words[1]) for words in lines if words[0] in ("VmRSS:", "RssAnon:")}
    return round(kb["VmRSS:"] / 1e3, 2), round(kb["RssAnon:"] / 1e3, 2)


@contextmanager
def browsing(chromium: str, folder: Path, address: str, flags: Sequence[str] = ()) -> Iterator[DevtoolsPage]:
    """Open a page at an address in a separate browser whose profile is in a folder."""
    (theirs_in, into), (out, theirs_out) = os.pipe(), os.pipe()
    with Path(os.devnull).open("rb+") as null:
        child = os.posix_spawn(
            chromium,
            [chromium, *FLAGS, *flags, f"--user-data-dir={folder}", address],
            dict(os.environ),
            file_actions=[
                *((os.POSIX_SPAWN_DUP2, null.fileno(), one) for one in (0, 1, 2)),
                (os.POSIX_SPAWN_DUP2, theirs_in, 3),  # where the protocol expects them
                (os.POSIX_SPAWN_DUP2, theirs_out, 4),
            ],
        )
    os.close(theirs_in)
    os.close(theirs_out)
    try:
        page = DevtoolsPage(into, out)
        yield page
        page.browser("Browser.close")
    finally:
        os.close(into)  # which ends it, too
        os.close(out)
        os.waitpid(child, 0)
