"""From a slider to the redrawn prediction on the evidence page, in headless Chromium: a joint, and a chain of eight.

    python -m benchmarks.evidence_page

3,000 readings; time from the new value to the picture on the screen, and what the server's part of it is. And from the
drop of a recording of 10 MB with its study on an empty page to the first pictures.
"""

from __future__ import annotations

import json
import os
import tempfile
import time
from pathlib import Path

import numpy as np
from tests.app.conftest import STUDY
from tests.app.page_user import READY, PageUser, opened

from pliant_app.controller import SessionController
from pliant_app.folder import SessionFolder

READINGS, MOVES = 3000, 60
DROPPED_MB, BYTES_OF_READING = 10, 29
SEARCHED_MS = 4000  # a user needs longer to find files


def recording(readings: int = READINGS) -> str:
    """Return six runs of a slow triangle; the readings are arbitrary."""
    lines = ["run,time_s,pressure_pa,angle_rad"]
    for k in range(6):
        time_s = np.arange(readings // 6) * 0.1
        pressure = 10e3 * np.abs((time_s / 12.5 + 0.1 * k) % 2 - 1)
        lines += [f"r{k},{t:.2f},{p:.1f},{4e-5 * p:.6f}" for t, p in zip(time_s, pressure, strict=True)]
    return "\n".join(lines) + "\n"


def main() -> None:
    found = {}
    for name, modules in (("joint", 1), ("chain of eight", 8)):
        with tempfile.TemporaryDirectory() as text:
            folder = Path(text)
            (folder / "bench.csv").write_text(recording())
            length = (
                f"modules: {modules}, module_length: {80 / modules:g} mm, module_mass: {40 / modules:g} g"
            )
            (folder / "bend.yaml").write_text(
                STUDY.replace("modules: 1, module_length: 80 mm, module_mass: 40 g", length)
            )
            controller = SessionController(SessionFolder(folder / "session"), folder / "store")
            controller.begin(folder / "bend.yaml", [])
            for kind in ("actuation_gain", "viscoelastic"):
                begun = next(
                    one["begun"] for one in controller.view()["model"]["catalogue"] if one["kind"] == kind
                )
                controller.step((begun,), [], kind)
                found[f"{name}, {kind}"] = _timed(controller, folder, begun)
    shown = {"mb": DROPPED_MB, "first_screen_s": first_screen()}
    print(json.dumps({"load": os.getloadavg()[0], "ms": found, **shown}, indent=1))


def first_screen() -> list[float]:
    """Return the seconds until the pictures of a large recording are drawn, each time on a new server."""
    seconds = []
    for _ in range(3):
        with tempfile.TemporaryDirectory() as text:
            folder = Path(text)
            (folder / "bench.csv").write_text(recording(round(DROPPED_MB * 1e6 / BYTES_OF_READING)))
            (folder / "bend.yaml").write_text(STUDY)
            with opened(folder / "session", folder / "store") as (page, _):
                page.wait_for_timeout(SEARCHED_MS)
                seconds.append(round(PageUser(page).drop([folder / "bench.csv", folder / "bend.yaml"]), 2))
    return seconds


def _timed(controller: SessionController, folder: Path, begun: dict[str, float]) -> dict[str, float]:
    strength = next(key for key in begun if key != "kind")
    values = [{**begun, strength: begun[strength] * (1.0 + 0.002 * k)} for k in range(MOVES)]
    parts = controller.preview((begun,))["parts"]
    wall, cpu = [], []
    for one in values:
        at, busy = time.perf_counter(), time.process_time()
        controller.preview((one,), parts)
        wall.append(1e3 * (time.perf_counter() - at))
        cpu.append(1e3 * (time.process_time() - busy))
    with opened(folder / "session", folder / "store", READY) as (page, _):
        drawn = [page.evaluate("e => pliantRedraw(e)", [one]) for one in values]
    return {
        "redrawn_median": round(float(np.median(drawn)), 1),
        "redrawn_95": round(float(np.percentile(drawn, 95)), 1),
        "server_95": round(float(np.percentile(wall, 95)), 1),
        "server_cpu_median": round(float(np.median(cpu)), 1),
    }


if __name__ == "__main__":
    main()
