"""Open the sealed label of this folder: what was hidden in bench.csv?

python examples/hidden_effect/open_label.py            asks for the passphrase, which the tutorial ends with
python examples/hidden_effect/open_label.py WORDS…     takes it from the command line
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmarks.evidence.seal import BrokenSealError, passphrase_key, unseal

LABEL = Path(__file__).resolve().parent / "label.sealed"


def main(words: list[str]) -> int:
    """Print the label; 2 where the passphrase does not open it."""
    passphrase = " ".join(words) or input("passphrase: ")
    try:
        label = unseal(LABEL.read_text(), passphrase_key(passphrase))
    except BrokenSealError as error:
        print(f"The label stays closed: {error}.", file=sys.stderr)
        return 2
    print(f"hidden effect: {label['kind']}")
    print(f"size:          {label['snr_reached']:.1f} times the noise (root mean square over the runs)")
    print(f"made by:       {label['engine']}, with noise of {label['sigma']['angle_rad']:.4f} rad")
    print("parameters of the truth, whose equations are not those of the candidates:")
    for name, value in label["drawn"].items():
        print(f"  {name:20s} {value:.4g}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
