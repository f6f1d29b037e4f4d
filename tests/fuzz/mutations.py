"""Seeded damage to texts and bytes, as made by editors, loggers, disks and attackers."""

from __future__ import annotations

import random
import re
from collections.abc import Callable, Sequence

WORDS = (
    *("!!float ", "!!python/object/apply:os.system [x]", "!!bool ", "&a ", "*a", "<<: *a", "? ", ": ", "- ", "---\n"),
    "\t",
    *("[", "]", "{", "}", "(", ")", "'", '"', "|\n", ">\n", "#", "%", "~", "null", "true", ".nan", ".inf", "-.inf"),
    "0", "-1",
    *("1e308", "-1e308", "1e-320", "1e150", "0x" + "f" * 300, "9" * 400, "1_000", "1:30", "NaN", "2026-13-45"),
    "1,5", "1.5.5",
    *("−1", "١", "$a_$", "\x1b[31m", "\0", "\r", "\u2028", "\ufeff", "\u202e", "é", "𝟘", "[red]", "<b>"),
    " mm", " kPa",
    *(" m^10^10", "**", " and ", "<=", "==", "sum(", "sqrt(", ",", ";", "__record__", "__array__", "../../x"),
)  # fmt: skip
NUMBER = re.compile(r"-?\d+\.?\d*(?:[eE][-+]?\d+)?")
WORD = re.compile(r"[A-Za-z_]\w*")


def mutated(rng: random.Random, seeds: Sequence[bytes]) -> bytes:
    """Return one of the seeds with one to four kinds of damage."""
    data = rng.choice(seeds)
    for _ in range(rng.choice((1, 1, 2, 4))):
        data = rng.choice(DAMAGES)(rng, data, seeds)[: 1 << 21]
    return data


def _span(rng: random.Random, data: bytes, most: int = 40) -> tuple[int, int]:
    start = rng.randrange(len(data) + 1)
    return start, min(len(data), start + rng.randrange(most))


def _bits(rng: random.Random, data: bytes, _: Sequence[bytes]) -> bytes:
    changed = bytearray(data)
    for _k in range(rng.randrange(1, 8) if changed else 0):
        changed[rng.randrange(len(changed))] ^= 1 << rng.randrange(8)
    return bytes(changed)


def _inserted(rng: random.Random, data: bytes, _: Sequence[bytes]) -> bytes:
    start, _end = _span(rng, data)
    return data[:start] + rng.choice(WORDS).encode("utf-8", "surrogatepass") + data[start:]


def _removed(rng: random.Random, data: bytes, _: Sequence[bytes]) -> bytes:
    start, end = _span(rng, data)
    return data[:start] + data[end:]


def _cut(rng: random.Random, data: bytes, _: Sequence[bytes]) -> bytes:
    return data[: rng.randrange(len(data) + 1)]


def _repeated(rng: random.Random, data: bytes, _: Sequence[bytes]) -> bytes:
    start, end = _span(rng, data)
    times = rng.choice((2, 10, 1000, 20_000))
    return data[:start] + (data[start:end] * times)[:200_000] + data[start:]


def _lines(rng: random.Random, data: bytes, _: Sequence[bytes]) -> bytes:
    lines = data.split(b"\n")
    a, b = rng.randrange(len(lines)), rng.randrange(len(lines))
    how = rng.randrange(3)
    if how == 0:
        lines[a], lines[b] = lines[b], lines[a]
    elif how == 1:
        lines.insert(a, lines[b])
    else:
        del lines[a]
    return b"\n".join(lines)


def _spliced(rng: random.Random, data: bytes, seeds: Sequence[bytes]) -> bytes:
    other = rng.choice(seeds)
    return data[: rng.randrange(len(data) + 1)] + other[rng.randrange(len(other) + 1) :]


def _replaced(pattern: re.Pattern[str]) -> Callable[[random.Random, bytes, Sequence[bytes]], bytes]:
    """Put another word of the file, or one of `WORDS`, in the place of a match of the pattern."""

    def damage(rng: random.Random, data: bytes, _: Sequence[bytes]) -> bytes:
        text = data.decode("latin-1")
        found = [match.span() for match in pattern.finditer(text[:100_000])]
        if not found:
            return data
        (start, end), (a, b) = rng.choice(found), rng.choice(found)
        new = data[a:b] if rng.random() < 0.3 else rng.choice(WORDS).encode("utf-8", "surrogatepass")
        return data[:start] + new + data[end:]

    return damage


DAMAGES: tuple[Callable[[random.Random, bytes, Sequence[bytes]], bytes], ...] = (
    *(_bits, _inserted, _inserted, _removed, _cut, _repeated, _lines, _spliced),
    *(_replaced(NUMBER), _replaced(NUMBER), _replaced(WORD)),
)
