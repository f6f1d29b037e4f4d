"""Memory growth of the evidence page during use: ticks, sliders, marks, undo and redo, in headless Chromium.

    python -m benchmarks.page_memory --minutes 60
    python -m benchmarks.page_memory --minutes 5 --snapshots    what grew, by kind of object, instead

Prints, minute by minute, MB resident of the process that renders the page (whole, and without mapped files), the page's
memory after garbage collection (heap in MB, nodes and listeners of the document), and the memory of the server's
process; and the growth from the end of the first minute, and of the fifth, to the last. Snapshots themselves increase
the memory, so they are a separate run.
"""

from __future__ import annotations

import json
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np
from benchmarks.devtools import DevtoolsPage, browsing, resident_mb
from benchmarks.output import Bar, make_parser, write
from tests.app.conftest import STUDY, recording
from tests.app.test_in_the_browser import CHROMIUM, QUIET, started

EFFECT = "actuation_gain"
MOVES = 20  # of a slider in a round
MOST = 0.1
WARM = (1, 5)  # minutes from whose end growth is counted
Row = dict[str, float]
SETTLED = "document.body.dataset.ready === String(version) && document.querySelector('#job').hidden"


def used(page: DevtoolsPage, server: int) -> Row:
    """Return the memory in use after garbage collection."""
    page.send("HeapProfiler.collectGarbage")
    counted = page.send("Memory.getDOMCounters")
    whole, own = resident_mb(page.process())
    return {
        "process_mb": whole,
        "process_own_mb": own,
        "heap_mb": round(page.send("Runtime.getHeapUsage")["usedSize"] / 1e6, 3),
        "nodes": counted["nodes"],
        "listeners": counted["jsEventListeners"],
        "server_mb": resident_mb(server)[0],
    }


def held(page: DevtoolsPage) -> Counter[str]:
    """Return bytes of the page's heap by kind and constructor of objects, from a snapshot."""
    page.events.clear()
    page.send("HeapProfiler.takeHeapSnapshot", reportProgress=False)
    chunks = (
        one["params"]["chunk"] for one in page.events if one["method"] == "HeapProfiler.addHeapSnapshotChunk"
    )
    found = json.loads("".join(chunks))
    fields, kinds = found["snapshot"]["meta"]["node_fields"], found["snapshot"]["meta"]["node_types"][0]
    table = np.array(found["nodes"]).reshape(-1, len(fields))
    named = {"object", "closure", "code", "native"}  # of others the name is their content
    total: Counter[str] = Counter()
    for kind, name, size in table[:, [fields.index(one) for one in ("type", "name", "self_size")]].tolist():
        what = f"{kinds[kind]} {found['strings'][name]}" if kinds[kind] in named else kinds[kind]
        total[what] += size
    return total


def tick(page: DevtoolsPage) -> None:
    """Tick the effect, which is not ticked."""
    page.evaluate("(document.querySelector('#effects details.more') || {}).open = true")
    page.click(f"#effect-{EFFECT}")
    page.until(f"view.model.effects.some(one => one.kind === '{EFFECT}') && {SETTLED}")


def perform_round(page: DevtoolsPage) -> None:
    """Perform a user's typical actions; afterwards only the history differs from before."""
    tick(page)
    begun = page.evaluate(f"view.model.effects.find(one => one.kind === '{EFFECT}')")
    strength = next(key for key in begun if key != "kind")
    for k in range(MOVES):
        page.evaluate(f"pliantRedraw([{json.dumps({**begun, strength: begun[strength] * (1 + 0.01 * k)})}])")
    left, top, width, height = page.box("#residual .u-over")
    end = (left + 0.5 * width, top + height - 10)
    page.drag([(left + 5, top + 10), (left + 0.3 * width, top + 0.5 * height), end])
    assert page.evaluate("marked !== null")
    for choice in ("against", "over"):
        for name in page.evaluate(f"[...$('{choice}').options].map(one => one.value)"):
            page.evaluate(
                f"$('{choice}').value = {json.dumps(name)}; $('{choice}').dispatchEvent(new Event('change'))"
            )
    for button, by in (("#undo", -1), ("#redo", 1), ("#undo", -1)):
        cursor = page.evaluate("view.model.cursor")
        page.click(button)
        page.until(f"view.model.cursor === {cursor + by} && {SETTLED}")


def growth(rows: list[Row]) -> Row:
    """Return the growth from the end of the warm minutes to the last."""
    return {
        f"{name}_from_minute_{start}": round(rows[-1][name] / rows[start][name] - 1, 4)
        for start in WARM
        if start < len(rows) - 1
        for name in rows[0]
        if name != "rounds"
    }


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("--minutes", type=float, default=5.0)
    parser.add_argument("--snapshots", action="store_true", help="what grew, by kind of object")
    given = parser.parse_args()
    if CHROMIUM is None:
        raise SystemExit("chromium is not installed: apt-get install chromium")
    rows: list[Row] = []
    seen: list[Counter[str]] = []
    with tempfile.TemporaryDirectory() as text:
        folder = Path(text)
        files = [folder / "bench.csv", folder / "bend.yaml"]
        for file, content in zip(files, (recording(), STUDY), strict=True):
            file.write_text(content)
        server, address = started(folder / "session", folder / "store")
        try:
            with browsing(CHROMIUM, folder / "profile", address, QUIET) as page:
                page.until("window.pliantRedraw && !document.querySelector('#begin').hidden")
                page.give("#files", files)
                page.until(f"view && view.model && {SETTLED}")
                began, rounds = time.monotonic(), 0
                while len(rows) < given.minutes + 1:
                    if time.monotonic() - began >= 60 * len(rows):
                        if given.snapshots and len(rows) in (1, int(given.minutes)):
                            seen.append(held(page))
                        rows.append({"rounds": rounds, **used(page, server.pid)})
                        print(json.dumps(rows[-1]), flush=True)
                    perform_round(page)
                    rounds += 1
        finally:
            server.terminate()
            server.wait()
    if given.snapshots:
        for what, more in (seen[-1] - seen[0]).most_common(25):
            print(f"{more:9d} bytes more  {what}")
        return
    found = growth(rows)
    bars = [
        Bar(
            f"growth of {what} in {given.minutes:.0f} minutes, from the end of the first",
            found.get(key),
            MOST,
            "%",
            scale=100,
        )
        for what, key in (
            ("the page's process", "process_mb_from_minute_1"),
            ("its script heap", "heap_mb_from_minute_1"),
        )
    ]
    write("page_memory", {"minutes": given.minutes, **found, "rows": rows}, bars)


if __name__ == "__main__":
    main()
