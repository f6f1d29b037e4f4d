"""Solve the designs behind the arm's meta-model:

    python examples/three_chamber_arm/make.py [--store DIR] [--workers N]

writes arm_grid.csv from fem/arm_grid.yaml. Two minutes of one processor; designs in the store are not solved again.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from pliant import api
from pliant_designs.sweep_table import write_sweep_table

HERE = Path(__file__).parent
DIGITS = 9


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--store", type=Path, default=Path(".pliant/store"))
    parser.add_argument("--workers", type=int, default=None)
    options = parser.parse_args()
    run = api.sweep(api.open_study(HERE / "fem/arm_grid.yaml", store=options.store), workers=options.workers)
    write_sweep_table(run, HERE / "arm_grid.csv", DIGITS)
    print(f"arm_grid.csv: {len(run.done())} designs, {sum(one.n_states for one in run.done())} states")


if __name__ == "__main__":
    main()
