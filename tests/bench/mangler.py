"""A line that drops, delays, doubles and damages what it carries, both ways."""

from __future__ import annotations

import heapq
import time

import numpy as np

from pliant_bench.drivers.line_protocol import Line


class Mangler:
    """Wrapper of a line that does each of four things to this share of the lines in both directions.

    Args:
        line: that carries the bytes.
        share: of the lines, for each of the four.
        seed: of the choice.
        delay_s: largest delay of a line.
    """

    def __init__(self, line: Line, share: float = 0.1, seed: int = 0, delay_s: float = 0.06) -> None:
        self._line, self._share, self._delay_s = line, share, delay_s
        self._rng = np.random.default_rng(seed)
        self._partial = b""
        self._going: list[tuple[float, int, bytes]] = []
        self._coming: list[tuple[float, int, bytes]] = []
        self._number = 0
        self.mangled = dict.fromkeys(("dropped", "delayed", "doubled", "damaged"), 0)

    def write(self, data: bytes) -> None:
        for line in data.splitlines(keepends=True):
            self._mangle(line, self._going)
        self._send_due()

    def read(self) -> bytes:
        self._send_due()
        self._partial += self._line.read()
        *lines, self._partial = self._partial.split(b"\n")
        for line in lines:
            self._mangle(line + b"\n", self._coming)
        return b"".join(self._due(self._coming))

    def close(self) -> None:
        self._line.close()

    def _send_due(self) -> None:
        for line in self._due(self._going):
            self._line.write(line)

    def _mangle(self, line: bytes, queue: list[tuple[float, int, bytes]]) -> None:
        copies = 1
        due = time.monotonic()
        fate = self._rng.random() / self._share
        if fate < 1:
            copies, what = 0, "dropped"
        elif fate < 2:
            due, what = due + self._delay_s * self._rng.random(), "delayed"
        elif fate < 3:
            copies, what = 2, "doubled"
        elif fate < 4:
            line, what = self._damaged(line), "damaged"
        else:
            what = ""
        if what:
            self.mangled[what] += 1
        for _ in range(copies):
            self._number += 1
            heapq.heappush(queue, (due, self._number, line))

    def _damaged(self, line: bytes) -> bytes:
        """Return the line with one to three bits changed, or with a part that is missing."""
        data = bytearray(line)
        if self._rng.random() < 0.3:
            start = int(self._rng.integers(len(data)))
            del data[start : start + int(self._rng.integers(1, 6))]
            return bytes(data)
        for _ in range(int(self._rng.integers(1, 4))):
            data[int(self._rng.integers(len(data)))] ^= 1 << int(self._rng.integers(8))
        return bytes(data)

    @staticmethod
    def _due(queue: list[tuple[float, int, bytes]]) -> list[bytes]:
        due = []
        while queue and queue[0][0] <= time.monotonic():
            due.append(heapq.heappop(queue)[2])
        return due
