"""Solve the tables of this folder again: python examples/designs/make.py [NAME ...] [--store DIR] [--workers N]

Each table has a study fem/<name>.yaml with a sweep. Its states are written as <name>.csv, as `pliant fem` writes them
but with nine digits, which is what the solver's tolerance is worth. Designs in the store are not solved again.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from pliant import api
from pliant_designs.sweep_table import write_sweep_table

HERE = Path(__file__).parent
NAMES = ("bending_grid", "bending_test", "chambers_grid", "chambers_test", "helical_grid", "helical_test")
DIGITS = 9


def make(name: str, store: Path, workers: int | None) -> None:
    """Solve one study's sweep and write its table."""
    run = api.sweep(api.open_study(HERE / "fem" / f"{name}.yaml", store=store), workers=workers)
    write_sweep_table(run, HERE / f"{name}.csv", DIGITS)
    print(f"{name}: {len(run.done())} designs, {sum(o.n_states for o in run.done())} states", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help="all by default")
    parser.add_argument("--store", type=Path, default=Path(".pliant/store"))
    parser.add_argument("--workers", type=int, default=None)
    options = parser.parse_args()
    if unknown := sorted(set(options.names) - set(NAMES)):
        parser.error(f"no table '{unknown[0]}'; there are {', '.join(NAMES)}")
    for name in options.names or NAMES:
        make(name, options.store, options.workers)


if __name__ == "__main__":
    main()
