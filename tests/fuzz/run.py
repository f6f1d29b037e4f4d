"""Feed damaged inputs in numbers: `python -m tests.fuzz.run --cases 50000`; inputs that break a reader go to `finds`.

Each case has its own seed, so that a find comes back with `--seed S --only NUMBER`.
"""

from __future__ import annotations

import argparse
import hashlib
import random
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from tests.fuzz.judge import verdict
from tests.fuzz.mutations import mutated
from tests.fuzz.targets import Target, targets

FINDS = Path(__file__).parent / "finds"


def case(number: int, seed: int, all_targets: Sequence[Target]) -> tuple[Target, bytes]:
    """Return the reader and the input of a case; the readers take turns."""
    rng = random.Random(f"{seed}/{number}")
    target = all_targets[number % len(all_targets)]
    return target, mutated(rng, target.seeds)


def finds(numbers: Sequence[int], seed: int) -> Iterator[tuple[int, Target, bytes, str]]:
    """Yield the cases that broke their reader: number, reader, input, and the error."""
    every = targets()
    for number in numbers:
        target, data = case(number, seed, every)
        if wrong := verdict(target, data):
            yield number, target, data, wrong


def kept() -> list[Path]:
    """Return inputs that once broke a reader: `finds/READER-DIGEST.bin`."""
    return sorted(FINDS.glob("*.bin"))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=2000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", type=int, help="this case alone")
    options = parser.parse_args()
    end = options.first + options.cases
    numbers = range(options.first, end) if options.only is None else [options.only]
    began, places = time.process_time(), set()
    for number, target, data, wrong in finds(numbers, options.seed):
        print(f"case {number}, {target.name}: {wrong}", flush=True)
        place = (target.name, wrong.rpartition(" in ")[2])
        if place in places:  # one input for each place is enough
            continue
        places.add(place)
        name = f"{target.name.replace(' ', '_')}-{hashlib.sha256(data).hexdigest()[:10]}.bin"
        FINDS.mkdir(exist_ok=True)
        (FINDS / name).write_bytes(data)
    print(f"{len(numbers)} cases, {len(places)} places broken, {time.process_time() - began:.0f} s of CPU")
    return 1 if places else 0


if __name__ == "__main__":
    sys.exit(main())
