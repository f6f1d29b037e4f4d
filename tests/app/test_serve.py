"""The page's socket sends an answer at once: a head does not wait for its acknowledgement before the body follows."""

from __future__ import annotations

import asyncio
import socket

import pytest

pytest.importorskip("uvicorn", reason="pip install 'pliant[app]'")

from pliant.app.server import _bound


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
