"""Make the data of examples/hidden_effect: which effect they hide is drawn from a passphrase that is not in this file.

    python benchmarks/evidence/make_example.py 'the passphrase'

writes bench.csv and label.sealed; `examples/hidden_effect/open_label.py` opens the label with the same passphrase.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmarks.evidence.seal import passphrase_key, seal
from benchmarks.evidence.sets import SetSpec, make_set
from benchmarks.evidence.truths import KINDS

FOLDER = Path(__file__).resolve().parents[2] / "examples" / "hidden_effect"
SNR = 2.5
HEAD = (
    "# A bending joint on the bench: two specimens, seven runs each, in the order in which they were done.\n"
    "# Angles from an encoder; the load is a cord over a pulley that opposes bending.\n"
)


def drawn(passphrase: str) -> SetSpec:
    """Return the set of a passphrase."""
    key = passphrase_key(passphrase, salt=b"which effect")
    kind = KINDS[int.from_bytes(key[:8]) % len(KINDS)]
    return SetSpec(kind, int.from_bytes(key[8:12]), "mujoco", "joint", "example", "judged", SNR)


def main(passphrase: str, folder: Path = FOLDER) -> None:
    made = make_set(drawn(passphrase))
    (folder / "bench.csv").write_text(HEAD + made.csv)
    (folder / "label.sealed").write_text(seal(made.label, passphrase_key(passphrase)))


if __name__ == "__main__":
    main(sys.argv[1])
