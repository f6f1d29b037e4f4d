"""A running server refuses 2 GB with a sentence and in little memory, whatever length is declared."""

from __future__ import annotations

import http.client
import json
import re
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

import pytest

from pliant_app.uploads import MOST_BYTES

from .conftest import recording
from .page_user import opened
from .test_in_the_browser import CHROMIUM, LONG, started

TWO_GB = 2 * 1024**3
BLOCK = b"\0" * 1024**2
MOST_GROWTH_MB = 50.0

pytestmark = pytest.mark.slow


def sent(
    address: str, name: str, body: Iterator[bytes] | bytes, headers: dict[str, str]
) -> tuple[int, dict[str, str]]:
    """Return the answer to an upload, whether or not the server read all of it."""
    at = urlsplit(address)
    link = http.client.HTTPConnection(at.netloc, timeout=120)
    with suppress(ConnectionError):  # the server refuses it during the transfer; the answer has arrived
        link.request(
            "POST",
            f"/api/upload?name={name}",
            body,
            {"x-pliant-token": parse_qs(at.query)["token"][0], **headers},
        )
    answer = link.getresponse()
    return answer.status, json.loads(answer.read())


def memory_mb(process: int, line: str) -> float:
    found = re.search(rf"{line}:\s+(\d+) kB", Path(f"/proc/{process}/status").read_text())
    assert found is not None
    return int(found[1]) / 1e3


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="reads a process's memory from /proc")
def test_two_gigabytes_are_refused_in_bounded_memory(tmp_path: Path) -> None:
    server, address = started(tmp_path / "session", tmp_path / "store")
    taken = 0

    def zeros() -> Iterator[bytes]:
        nonlocal taken
        while taken < TWO_GB:
            yield BLOCK
            taken += len(BLOCK)

    try:
        assert sent(address, "bench.csv", recording().encode(), {})[0] == 200
        before, now = 0.0, memory_mb(server.pid, "VmRSS")
        while now > before + 1.0:  # the files of the first study are still being imported
            time.sleep(1.5)
            before, now = now, memory_mb(server.pid, "VmRSS")
        for headers, most_taken in (
            ({"content-length": str(TWO_GB)}, 64 * len(BLOCK)),
            ({}, MOST_BYTES + 64 * len(BLOCK)),
        ):
            taken = 0
            status, said = sent(address, "big.csv", zeros(), headers)
            assert status == 422 and "larger than 256 MB" in said["error"]
            assert taken < most_taken
        peak = memory_mb(server.pid, "VmHWM")
        print(f"the server held {now:.0f} MB before, {peak:.0f} MB at most")
        assert peak < now + MOST_GROWTH_MB
        assert [one.name for one in (tmp_path / "session" / "files").iterdir()] == ["bench.csv"]
    finally:
        server.terminate()
        server.wait()


@pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed: apt-get install chromium")
def test_the_page_refuses_two_gigabytes_by_itself(tmp_path: Path) -> None:
    big = tmp_path / "big.csv"
    with big.open("wb") as file:
        file.truncate(TWO_GB)  # a refused file takes no disk space
    with opened(tmp_path / "session", tmp_path / "store") as (page, _):
        asked: list[str] = []
        page.on("request", lambda request: asked.append(request.url))
        page.set_input_files("#files", str(big))
        page.wait_for_selector("#said:has-text('big.csv: the file is larger than 256 MB')", timeout=LONG)
        assert not any("upload" in one for one in asked)
