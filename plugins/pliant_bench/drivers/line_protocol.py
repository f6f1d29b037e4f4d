"""Line protocol between the computer and a microcontroller: numbered lines with checksums, one answer to each request.

A line is ``SEQUENCE BODY*CRC`` and a line feed: a number of 16 bits, the body, and the CRC-32 of all before the star in
eight hexadecimal digits. A request whose answer does not come in time is repeated with the next number, so that an
answer that is late, doubled or old has another number than the one that is waited for. The microcontroller ignores
lines that are damaged, and lines whose number is not above the last one. docs/connect_your_bench.md lists the requests.
"""

from __future__ import annotations

import threading
import time
import zlib
from dataclasses import dataclass
from typing import Protocol

from pliant_bench.bench import ConnectionLostError

MODULUS = 1 << 16
# A longer line is noise.
LONGEST_LINE = 512
LOCK_S = 0.5


class Line(Protocol):
    """A connection that carries bytes; its errors are `OSError`."""

    def write(self, data: bytes) -> None:
        """Send bytes."""

    def read(self) -> bytes:
        """Return the bytes that came, at the latest after a few milliseconds; none if none came."""

    def close(self) -> None:
        """Close the connection; also twice."""


def encode(sequence: int, body: str) -> bytes:
    """Return a line with its number and checksum."""
    text = f"{sequence} {body}".encode("ascii")
    return b"%s*%08X\n" % (text, zlib.crc32(text))


def decode(line: bytes) -> tuple[int, str] | None:
    """Return number and body of a line without its line feed, or None if it is damaged."""
    text, star, checksum = line.strip(b"\r\n").rpartition(b"*")
    if not star or len(checksum) != 8 or checksum != b"%08X" % zlib.crc32(text):
        return None
    number, space, body = text.decode("ascii", "replace").partition(" ")
    return (int(number), body) if space and number.isdecimal() else None


@dataclass
class LineCounts:
    """Events on a line: requests that were repeated or lost, and lines that were damaged or had an old number."""

    repeated: int = 0
    lost: int = 0
    damaged: int = 0
    old: int = 0


class LineClient:
    """The computer's end of the protocol.

    Args:
        line: the connection.
        timeout_s: time after which a request is repeated.
        attempts: how often a request is sent before it counts as lost.
    """

    def __init__(self, line: Line, timeout_s: float, attempts: int) -> None:
        self._line, self._timeout_s, self._attempts = line, timeout_s, attempts
        self._sequence = 0
        self._bytes = bytearray()
        self._lock = threading.Lock()
        self.counts = LineCounts()

    def ask(self, body: str, attempts: int | None = None) -> list[str] | None:
        """Return the words of the answer, the first of which is its kind, or None if no answer came.

        Raises:
            OSError: the connection is closed.
            ConnectionLostError: another request hangs.
        """
        if not self._lock.acquire(timeout=LOCK_S):
            raise ConnectionLostError("The connection to the bench hangs.")
        try:
            for attempt in range(attempts or self._attempts):
                self.counts.repeated += attempt > 0
                self._sequence = (self._sequence + 1) % MODULUS
                self._line.write(encode(self._sequence, body))
                answer = self._answer(time.monotonic() + self._timeout_s)
                if answer is not None:
                    return answer.split()
            self.counts.lost += 1
            return None
        finally:
            self._lock.release()

    def close(self) -> None:
        """Close the connection."""
        self._line.close()

    def _answer(self, deadline_s: float) -> str | None:
        """Return the body of the answer to the last request, if it comes before the deadline."""
        while True:
            while (end := self._bytes.find(b"\n")) >= 0:
                line = bytes(self._bytes[:end])
                del self._bytes[: end + 1]
                decoded = decode(line)
                if decoded is None:
                    self.counts.damaged += 1
                elif decoded[0] != self._sequence:
                    self.counts.old += 1
                else:
                    return decoded[1]
            if len(self._bytes) > LONGEST_LINE:
                self._bytes.clear()
            if time.monotonic() > deadline_s:
                return None
            self._bytes += self._line.read()
