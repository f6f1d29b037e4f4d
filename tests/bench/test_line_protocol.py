"""Lines with numbers and checksums: what is damaged, doubled, late or old is never taken for an answer."""

import zlib

import numpy as np
import pytest

from pliant_bench.drivers.line_protocol import LineClient, decode, encode


class Scripted:
    """A line whose answers are given by a function of each request."""

    def __init__(self, answers):
        self.answers, self.sent, self._waiting = answers, [], b""

    def write(self, data):
        self.sent.append(data)
        self._waiting += self.answers(len(self.sent), data)

    def read(self):
        data, self._waiting = self._waiting, b""
        return data

    def close(self):
        pass


def test_the_line_of_the_documentation():
    assert encode(17, "X 5000") == b"17 X 5000*%08X\n" % zlib.crc32(b"17 X 5000")
    assert decode(encode(17, "X 5000")) == (17, "X 5000")
    assert decode(encode(17, "X 5000").replace(b"\n", b"\r\n")) == (17, "X 5000")


@pytest.mark.parametrize(
    "line",
    [
        b"",
        b"*",
        b"17 X 5000",
        b"17 X 5000*",
        b"X 1*%08X" % zlib.crc32(b"X 1"),
        b"17*%08X" % zlib.crc32(b"17"),
    ],
)
def test_what_is_no_line_is_refused(line):
    assert decode(line) is None


def test_no_change_of_up_to_three_bits_is_taken_for_a_line():
    rng, line = np.random.default_rng(0), encode(123, "X 1234 5000.000000 0.123456")[:-1]
    for _ in range(20_000):
        data = bytearray(line)
        for bit in rng.choice(8 * len(data), int(rng.integers(1, 4)), replace=False):
            data[bit // 8] ^= 1 << (bit % 8)
        # A bit of the checksum's case or of white space at its end changes nothing that is sent.
        assert decode(bytes(data)) in (None, (123, "X 1234 5000.000000 0.123456"))


def test_a_lost_answer_is_asked_for_again_under_the_next_number():
    line = Scripted(lambda count, data: b"" if count < 3 else encode(count, "V 1"))
    client = LineClient(line, 0.01, 3)
    assert client.ask("V") == ["V", "1"]
    assert [decode(sent[:-1])[0] for sent in line.sent] == [1, 2, 3]
    assert (client.counts.repeated, client.counts.lost) == (2, 0)


def test_an_answer_to_an_earlier_request_is_never_taken():
    # The answer to the first request comes when the second is asked, twice; its own never comes.
    line = Scripted(lambda count, data: encode(count - 1, "X 1 0 0.5") * 2)
    client = LineClient(line, 0.01, 2)
    assert client.ask("X 0") is None
    assert client.ask("X 0") is None
    assert client.counts.old == 8 and client.counts.lost == 2


def test_damaged_lines_and_noise_are_counted_and_skipped():
    noise = b"\xff\x00" * 400
    line = Scripted(lambda count, data: noise + b"\n" + b"9 X*00000000\n" + encode(count, "X 2"))
    client = LineClient(line, 0.05, 1)
    assert client.ask("X 0") == ["X", "2"]
    assert client.counts.damaged == 2


def test_numbers_begin_again_after_16_bits():
    client = LineClient(Scripted(lambda count, data: encode(decode(data[:-1])[0], "V 1")), 0.05, 1)
    client._sequence = 65535
    assert client.ask("V") == ["V", "1"] and client._sequence == 0
