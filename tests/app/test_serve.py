"""The page's socket sends an answer at once: the body does not wait for the acknowledgement of the header."""

from __future__ import annotations

import asyncio
import socket
from pathlib import Path

import pytest

pytest.importorskip("uvicorn", reason="pip install 'pliant[app]'")

from pliant_app.folder import SessionFolder
from pliant_app.page_state import PageState
from pliant_app.server import _bound, session_folder


def test_two_studies_with_one_file_name_have_a_session_each(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    one, other = Path("one/finger.yaml"), Path("other/finger.yaml")
    usual = session_folder(one, None)
    assert usual == Path("runs/finger-app")
    SessionFolder(usual).keep(PageState(study=str(one.resolve())))
    assert session_folder(one, None) == usual
    own = session_folder(other, None)
    assert own != usual
    SessionFolder(own).keep(PageState(study=str(other.resolve())))
    assert (session_folder(one, None), session_folder(other, None)) == (usual, own)


def test_small_packets_are_sent_at_once() -> None:
    async def accepted() -> int:
        found: asyncio.Future[int] = asyncio.get_running_loop().create_future()

        async def take(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            mine = writer.get_extra_info("socket")
            found.set_result(mine.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY))
            writer.close()

        with _bound(0, exact=False) as bound:
            server = await asyncio.start_server(take, sock=bound)
            _, writer = await asyncio.open_connection(*bound.getsockname())
            told = await asyncio.wait_for(found, 10)
            writer.close()
            server.close()
        return told

    assert asyncio.run(accepted()) != 0
