"""The live page of an experiment: the same guard, the samples that are new, and the button that vents."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("starlette", reason="pip install 'pliant[app]'")
pytest.importorskip("httpx2", reason="starlette's test client needs httpx2")

from starlette.testclient import TestClient
from tests.bench.plain_bench import PlainBench
from tests.bench.test_folder import EXPECTED, begun
from tests.command import called

from pliant_app.server import experiment_application
from pliant_bench.loop.perform import STOP_BUTTON, perform

TOKEN = "right"
MINE = {"x-pliant-token": TOKEN}


def client(path: Path) -> TestClient:
    folder, _ = begun(path)
    return TestClient(experiment_application(folder, TOKEN), base_url="http://127.0.0.1:8642")


def test_foreign_requests_are_refused(tmp_path: Path) -> None:
    page = client(tmp_path)
    assert page.get("/api/state").status_code == 403
    assert (
        page.post("/api/vent", json={}, headers={**MINE, "origin": "http://evil.example"}).status_code == 403
    )
    assert not (tmp_path / "stop").exists()


def test_page_and_its_files_are_served(tmp_path: Path) -> None:
    page = client(tmp_path)
    assert "Stop and vent" in page.get(f"/?token={TOKEN}").text
    for name in ("experiment.js", "page.css", "vendor/uPlot.js"):
        assert page.get(f"/static/{name}").status_code == 200


def test_samples_come_once(tmp_path: Path) -> None:
    folder, one = begun(tmp_path)
    page = TestClient(experiment_application(folder, TOKEN), base_url="http://127.0.0.1:8642")
    one.write_expected(EXPECTED, one.read_protocol().time_s)
    perform(PlainBench(), one.read_protocol(), folder, one, [])
    first = page.get("/api/state?run=0&since=0", headers=MINE).json()["run"]
    assert first["count"] == len(first["series"]["angle_rad"]) == 40
    assert [one["name"] for one in first["models"]["outputs"]["angle_rad"]] == [
        "the study's model",
        "with backlash",
    ]
    later = page.get("/api/state?run=1&since=40&models=0", headers=MINE).json()["run"]
    assert later["series"]["angle_rad"] == [] and "models" not in later


def test_the_button_stops_the_run(tmp_path: Path) -> None:
    folder, one = begun(tmp_path)
    page = TestClient(experiment_application(folder, TOKEN), base_url="http://127.0.0.1:8642")

    def press(index: int) -> None:
        if index == 5:
            assert page.post("/api/vent", json={}, headers=MINE).status_code == 200

    recording = perform(PlainBench(before=press), one.read_protocol(), folder, one, [])
    assert recording.reason == STOP_BUTTON and len(recording) == 6


def test_another_folder_is_refused(tmp_path: Path) -> None:
    called("app", "--experiment", tmp_path, "--no-browser").refused("is no folder of an experiment")
