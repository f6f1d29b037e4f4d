"""Benches whose lines are dropped, delayed, doubled and damaged, 10 % of them each."""

from tests.bench.mangler import Mangler

from pliant_bench.drivers.serial_line import SerialBench
from pliant_bench.drivers.socket_line import SocketBench


class MangledSerial(SerialBench):
    """A serial bench whose line is mangled."""

    share = 0.1

    def open_line(self):
        self.mangler = Mangler(super().open_line(), self.share)
        return self.mangler


class MangledSocket(SocketBench):
    """A TCP bench whose line is mangled."""

    share = 0.1

    def open_line(self):
        self.mangler = Mangler(super().open_line(), self.share)
        return self.mangler
