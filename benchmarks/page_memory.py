"""Whether the evidence page grows while it is used: ticks, sliders, marks, undo and redo, in headless Chromium.

    python -m benchmarks.page_memory --minutes 5

Prints, minute by minute, what the page holds after its garbage was collected (heap in MB, nodes and listeners of the
document, MB of the heap that is no compiled code) and what the server's process holds (MB); and the growth from the
end of the first minute to the last.
"""

from __future__ import annotations

import json
import os
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.output import parser_of, write
from tests.app.conftest import STUDY, recording
from tests.app.page_user import PageUser, opened

EFFECT = "actuation_gain"
MOVES = 20  # of a slider in a round


def used(page: Any, session: Any, server: int) -> dict[str, float]:
    """What is held now, garbage collected."""
    session.send("HeapProfiler.collectGarbage")
    found = {one["name"]: one["value"] for one in session.send("Performance.getMetrics")["metrics"]}
    pages = int(Path(f"/proc/{server}/statm").read_text().split()[1])
    return {
        "page_mb": round(found["JSHeapUsedSize"] / 1e6, 2),
        "nodes": found["Nodes"],
        "listeners": found["JSEventListeners"],
        "objects_mb": objects_mb(session),
        "server_mb": round(pages * os.sysconf("SC_PAGE_SIZE") / 1e6, 1),
    }


def objects_mb(session: Any) -> float:
    """What the page itself holds: a heap snapshot without compiled code and what belongs to the browser."""
    chunks: list[str] = []
    session.on("HeapProfiler.addHeapSnapshotChunk", lambda event: chunks.append(event["chunk"]))
    session.send("HeapProfiler.takeHeapSnapshot", {"reportProgress": False})
    found = json.loads("".join(chunks))
    fields, kinds = found["snapshot"]["meta"]["node_fields"], found["snapshot"]["meta"]["node_types"][0]
    table = np.array(found["nodes"]).reshape(-1, len(fields))
    own = ~np.isin(table[:, fields.index("type")], [kinds.index(kind) for kind in ("code", "native")])
    return round(float(table[own, fields.index("self_size")].sum()) / 1e6, 3)


def round_of_use(user: PageUser) -> None:
    """What a user does again and again; it ends where it began but for the history."""
    page = user.page
    user.tick(EFFECT)
    begun = page.evaluate(f"view.model.effects.find(one => one.kind === '{EFFECT}')")
    strength = next(key for key in begun if key != "kind")
    for k in range(MOVES):
        page.evaluate("e => pliantRedraw(e)", [{**begun, strength: begun[strength] * (1 + 0.01 * k)}])
    box = page.locator("#residual .u-over").bounding_box()
    page.mouse.move(box["x"] + 5, box["y"] + 10)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + box["height"] - 10, steps=3)
    page.mouse.up()
    for choice in ("#against", "#over"):
        for name in page.locator(f"{choice} option").all_text_contents():
            page.select_option(choice, label=name)
    for button, by in (("#undo", -1), ("#redo", 1), ("#undo", -1)):
        cursor = page.evaluate("view.model.cursor")
        page.click(button)
        user.until(f"view.model.cursor === {cursor + by}")
        user.settled()


def main() -> None:
    parser = parser_of(__doc__)
    parser.add_argument("--minutes", type=float, default=5.0)
    given = parser.parse_args()
    rows: list[dict[str, float]] = []
    with tempfile.TemporaryDirectory() as text:
        folder = Path(text)
        (folder / "bench.csv").write_text(recording())
        (folder / "bend.yaml").write_text(STUDY)
        with opened(folder / "session", folder / "store") as (page, server):
            session = page.context.new_cdp_session(page)
            session.send("Performance.enable")
            user = PageUser(page)
            user.drop([folder / "bench.csv", folder / "bend.yaml"])
            began, rounds = time.monotonic(), 0
            while len(rows) < given.minutes + 1:
                if time.monotonic() - began >= 60 * len(rows):
                    rows.append({"rounds": rounds, **used(page, session, server)})
                    print(json.dumps(rows[-1]), flush=True)
                round_of_use(user)
                rounds += 1
    first, last = rows[min(1, len(rows) - 1)], rows[-1]
    growth = {f"{name}_growth": round(last[name] / first[name] - 1, 4) for name in first if name != "rounds"}
    write("page_memory", {"minutes": given.minutes, **growth, "rows": rows})


if __name__ == "__main__":
    main()
