"""What becomes of files as labs have them: read with the right numbers, asked about, or wrong without a word.

    python -m benchmarks.lab_files        prints; exit code 1 where a file was read wrong without a word

The files and their answers are those of tests/lab_files, written down before the reader was.
"""

from __future__ import annotations

import sys
import tempfile
from collections import Counter
from pathlib import Path

from tests.lab_files.files import lab_files
from tests.lab_files.judge import kind_of, read
from tests.lab_files.lab_file import LabFile

WORDS = {
    "right": "read with the right numbers",
    "refused": "refused with a sentence",
    "doubted": "read as they say, and doubted with the line to write",
    "wrong": "wrong without a word",
}


def main() -> int:
    """Print how many files come to what, as they are and once the user has answered."""
    counts: Counter[str] = Counter()
    settled = asked = 0
    for lab in lab_files():
        kind, told = _judged(lab)
        counts[kind] += 1
        asked += told is not None
        settled += bool(told)
        print(f"{kind:8} {'' if told is None else '→ right' if told else '→ NOT right':12} {lab.name}")
    print(f"\n{sum(counts.values())} files")
    for kind, words in WORDS.items():
        print(f"{counts[kind]:4} {words}")
    print(f"{settled:4} of {asked} that can be settled are read right after the user's answer")
    return 1 if counts["wrong"] or settled < asked else 0


def _judged(lab: LabFile) -> tuple[str, bool | None]:
    """What becomes of a file as it is, and whether it is right after the answer; None where nothing can be said."""
    with tempfile.TemporaryDirectory() as folder:
        kind = kind_of(lab, read(lab, Path(folder)))
        told = read(lab, Path(folder), lab.stated) if lab.stated else None
    return kind, None if told is None else told.measurement is not None and not told.wrong


if __name__ == "__main__":
    sys.exit(main())
