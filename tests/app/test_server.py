"""The server refuses requests that do not come from its own page, and treats files as data only."""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import AsyncIterator
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("starlette", reason="pip install 'pliant[app]'")
pytest.importorskip("httpx2", reason="starlette's test client needs httpx2")

from starlette.testclient import TestClient

from pliant.errors import UserError
from pliant.report.chart import Chart, ChartAxis, ChartLine, Panel
from pliant.report.document import Document, Picture, drawn, section
from pliant.report.render import page
from pliant.report.scene import DrawnScene
from pliant_app import uploads
from pliant_app.controller import SessionController
from pliant_app.folder import SessionFolder
from pliant_app.server import application
from pliant_app.uploads import receive, safe_name

from .conftest import STUDY, recording

TOKEN = "right"
MINE = {"x-pliant-token": TOKEN}


@pytest.fixture
def empty(tmp_path: Path) -> tuple[TestClient, SessionController]:
    controller = SessionController(SessionFolder(tmp_path / "session"), tmp_path / "store")
    return TestClient(application(controller, TOKEN), base_url="http://127.0.0.1:8642"), controller


@pytest.mark.parametrize(
    "headers",
    [
        {},
        {"x-pliant-token": "wrong"},
        {**MINE, "host": "evil.example:8642"},
        {**MINE, "origin": "http://evil.example"},
        {**MINE, "origin": "null"},
        {**MINE, "sec-fetch-site": "cross-site"},
        {**MINE, "sec-fetch-site": "same-site"},
    ],
)
def test_foreign_requests_are_refused(
    empty: tuple[TestClient, SessionController], headers: dict[str, str]
) -> None:
    client, controller = empty
    for method, path in (("GET", "/api/view"), ("POST", "/api/example"), ("POST", "/api/upload?name=a.csv")):
        answer = client.request(method, path, headers=headers)
        assert answer.status_code == 403
        assert answer.text.startswith("Refused: ")
    assert controller.state.study == ""


def test_a_form_on_another_site_cannot_pass_the_token_in_the_address(
    empty: tuple[TestClient, SessionController],
) -> None:
    client, controller = empty
    assert client.post(f"/api/example?token={TOKEN}").status_code == 403
    assert client.get(f"/?token={TOKEN}").status_code == 200
    assert controller.state.study == ""


def test_no_page_may_frame_it_and_no_foreign_script_runs(empty: tuple[TestClient, SessionController]) -> None:
    policy = empty[0].get(f"/?token={TOKEN}").headers["content-security-policy"]
    assert "default-src 'none'" in policy and "frame-ancestors 'none'" in policy
    assert "script-src 'self';" in policy


def test_scripts_in_a_report_are_allowed_by_what_is_in_them(
    empty: tuple[TestClient, SessionController],
) -> None:
    client, controller = empty
    controller.folder.results.joinpath("a.html").write_text("<p>", "utf-8")
    policy = client.get("/result/a.html", headers=MINE).headers["content-security-policy"]
    allowed = re.search(r"script-src ([^;]*);", policy)
    assert allowed is not None and "unsafe" not in allowed[1] and "allow-same-origin" not in policy
    scripts = re.findall(r"<script>(.*?)</script>", page(_moving_document()).html, re.DOTALL)
    digests = [base64.b64encode(hashlib.sha256(one.encode()).digest()).decode() for one in scripts]
    assert len(scripts) == 5
    assert sorted(allowed[1].split()) == sorted(f"'sha256-{one}'" for one in digests)


def _moving_document() -> Document:
    x = np.arange(3.0)
    chart = Chart((Panel(ChartAxis("a"), ChartAxis("b"), (ChartLine("measured", x, x),)),))
    shown = Picture("one", "one", chart)
    scene = DrawnScene("state", ("a", "b"), (), (), (), np.eye(3), np.zeros(3), 1.0)
    turned = section("In space", Picture("two", "two", np.zeros(8, np.uint8), scene=scene))
    return Document(kind="k", title="t", sentence="s", data={}, draw=lambda: drawn(shown, turned))


@pytest.mark.parametrize(
    "path",
    ["/static/../controller.py", "/static/%2e%2e/controller.py", "/static/", "/result/..%2fsession.json"],
)
def test_nothing_but_its_own_files_is_served(empty: tuple[TestClient, SessionController], path: str) -> None:
    assert empty[0].get(path, headers=MINE).status_code == 404


def test_dropped_files_open_a_study(empty: tuple[TestClient, SessionController]) -> None:
    client, _ = empty
    assert client.post("/api/upload?name=bench.csv", headers=MINE, content=recording()).status_code == 200
    read = client.get("/api/view", headers=MINE).json()["recording"]
    assert "240" in read["sentence"]
    assert client.post("/api/upload?name=bend.yaml", headers=MINE, content=STUDY).status_code == 200
    view = client.get("/api/view", headers=MINE).json()
    assert view["model"]["name"] == "bend"


def test_hostile_names_are_inert(empty: tuple[TestClient, SessionController]) -> None:
    assert safe_name("../../etc/passwd.csv") == "passwd.csv"
    assert safe_name("C:\\Windows\\x.CSV") == "x.csv"
    assert safe_name("<img src=x onerror=alert(1)>.csv") == "_img src=x onerror=alert(1)_.csv"
    assert safe_name("\u202egnp.csv") == "_gnp.csv"
    assert safe_name("a" * 500 + ".csv") == "a" * 76 + ".csv"
    assert safe_name("con.csv") == "_con.csv"
    for bad in ("", ".csv", "run.py", "x.html", "a.csv.exe", "../..", "a\0.so"):
        with pytest.raises(UserError):
            safe_name(bad)
    client, controller = empty
    client.post("/api/upload?name=..%2f..%2fout.csv", headers=MINE, content=recording())
    assert [one.name for one in controller.folder.files.iterdir()] == ["out.csv"]


@pytest.mark.parametrize(
    "line",
    [
        "plugins: [evil.py]",
        "extends: /etc/passwd",
        "measurements: {file: ../secret.csv}",
        "measurements: {file: /etc/passwd}",
    ],
)
def test_a_dropped_study_runs_nothing_and_stays_in_its_folder(
    empty: tuple[TestClient, SessionController], line: str
) -> None:
    client, controller = empty
    text = STUDY.replace("measurements: {file: bench.csv}", line)
    answer = client.post("/api/upload?name=bend.yaml", headers=MINE, content=text)
    assert answer.status_code == 422
    assert (
        line.split(":")[0] in answer.json()["error"]
        or "leaves the session's folder" in answer.json()["error"]
    )
    assert controller.state.study == "" and not list(controller.folder.files.iterdir())


def test_an_upload_is_bounded_whatever_it_declares(
    empty: tuple[TestClient, SessionController], monkeypatch: pytest.MonkeyPatch
) -> None:
    client, controller = empty
    two_gb = {**MINE, "content-length": str(2 * 1024**3)}
    answer = client.post("/api/upload?name=big.csv", headers=two_gb, content=b"x")
    assert answer.status_code == 422 and "larger than 256 MB" in answer.json()["error"]
    monkeypatch.setattr(uploads, "MOST_BYTES", 1000)
    answer = client.post("/api/upload?name=big.csv", headers=MINE, content=b"x" * 2000)
    assert answer.status_code == 422
    assert not list(controller.folder.files.iterdir())


def test_a_body_that_breaks_off_leaves_no_file(tmp_path: Path) -> None:
    async def broken() -> AsyncIterator[bytes]:
        yield b"run,"
        raise ConnectionError

    import asyncio

    with pytest.raises(ConnectionError):
        asyncio.run(receive(broken(), None, tmp_path / "a.csv"))
    assert not list(tmp_path.iterdir())


def test_run_names_in_a_recording_stay_text(empty: tuple[TestClient, SessionController]) -> None:
    client, _ = empty
    hostile = recording().replace("r0,", "<script>alert(1)</script>,")
    client.post("/api/upload?name=bench.csv", headers=MINE, content=hostile)
    client.post("/api/upload?name=bend.yaml", headers=MINE, content=STUDY)
    answer = client.get("/api/curves", headers=MINE)
    assert answer.headers["content-type"] == "application/json"
    assert answer.json()["runs"][0]["name"] == "<script>alert(1)</script>"
    page = (Path(uploads.__file__).parent / "static" / "page.js").read_text()
    assert "innerHTML" not in page


def test_a_request_that_is_not_understood_says_so(empty: tuple[TestClient, SessionController]) -> None:
    client, _ = empty
    for body in (b"[1]", b"{", b"{}"):
        answer = client.post("/api/preview", headers=MINE, content=body)
        assert answer.status_code == 400 and "error" in answer.json()
    assert client.post("/api/run", headers=MINE, json={"what": "rm"}).status_code == 422
    assert client.post("/api/preview", headers=MINE, json={"effects": ["x" * 2_000_000]}).status_code == 422
