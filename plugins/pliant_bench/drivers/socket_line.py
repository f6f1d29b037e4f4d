"""Bench on a TCP port, such as a microcontroller on Ethernet or a program that owns the hardware."""

from __future__ import annotations

import socket

from pliant.errors import UserError
from pliant_bench.drivers.line_bench import LineBench
from pliant_bench.drivers.line_config import SocketConfig
from pliant_bench.drivers.line_protocol import Line

READ_S, CONNECT_S = 0.002, 3.0


class TcpConnection:
    """The bytes of a TCP connection."""

    def __init__(self, connection: socket.socket) -> None:
        self._socket = connection
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket.settimeout(READ_S)

    def write(self, data: bytes) -> None:
        self._socket.sendall(data)

    def read(self) -> bytes:
        try:
            data = self._socket.recv(4096)
        except TimeoutError:
            return b""
        if not data:
            raise ConnectionResetError("the bench closed the connection")
        return data

    def close(self) -> None:
        self._socket.close()


class SocketBench(LineBench):
    """A program or microcontroller that speaks the line protocol on a TCP port."""

    config: SocketConfig

    @property
    def address(self) -> str:
        return f"{self.config.host}:{self.config.port}"

    def open_line(self) -> Line:
        config = self.config
        try:
            return TcpConnection(socket.create_connection((config.host, config.port), CONNECT_S))
        except OSError as error:
            raise UserError(
                f"Nothing answers at {self.address} ({error.strerror or error}); start the bench's program, or state "
                "another address as bench: {kind: socket, host: …, port: …}."
            ) from None
