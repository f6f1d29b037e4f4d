"""Solve the tables of this folder again: python examples/designs/make.py [NAME ...] [--store DIR] [--workers N]

Each table has a study fem/<name>.yaml with a sweep. Its states are written as <name>.csv, as `pliant fem` writes them
but with nine digits, which is what the solver's tolerance is worth. Designs in the store are not solved again.
"""

from __future__ import annotations

import argparse
import csv
import io
import tempfile
from pathlib import Path

from pliant import api
from pliant.pipeline.sweep_table import write_sweep_table

HERE = Path(__file__).parent
NAMES = ("bending_grid", "bending_test", "helical_grid", "helical_test")
DIGITS = 9
# How long a state took is worth three.
SHORT = ("wall_s",)


def make(name: str, store: Path, workers: int | None) -> None:
    """Solve one study's sweep and write its table."""
    run = api.sweep(api.open_study(HERE / "fem" / f"{name}.yaml", store=store), workers=workers)
    with tempfile.TemporaryDirectory() as folder:
        whole = Path(folder) / "whole.csv"
        write_sweep_table(run, whole)
        (HERE / f"{name}.csv").write_text(shortened(whole.read_text(encoding="utf-8")), encoding="utf-8")
    print(f"{name}: {len(run.done())} designs, {sum(o.n_states for o in run.done())} states", flush=True)


def shortened(text: str) -> str:
    """The table with fewer digits."""
    rows = list(csv.reader(io.StringIO(text)))
    header, out = rows[0], io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(header)
    for row in rows[1:]:
        writer.writerow([_cell(name, cell) for name, cell in zip(header, row, strict=True)])
    return out.getvalue()


def _cell(name: str, cell: str) -> str:
    try:
        value = float(cell)
    except ValueError:
        return cell
    if cell.lstrip("-").isdecimal():
        return cell
    return f"{value:.{3 if name in SHORT else DIGITS}g}"


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
