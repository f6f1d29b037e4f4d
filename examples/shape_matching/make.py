"""Solve a sixth row of designs between those of ../designs/helical_grid.csv:

    python examples/shape_matching/make.py [--store DIR] [--workers N]

writes shape_grid.csv, the table that helix.yaml reads: 30 designs. Three minutes on two cores; designs in the store are
not solved again.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

from pliant import api
from pliant_designs.sweep_table import write_sweep_table

HERE = Path(__file__).parent
GRID = HERE.parent / "designs" / "helical_grid.csv"
TABLE = HERE / "shape_grid.csv"
DIGITS = 9  # as the grid has


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--store", type=Path, default=Path(".pliant/store"))
    parser.add_argument("--workers", type=int, default=None)
    options = parser.parse_args()
    run = api.sweep(api.open_study(HERE / "fem/between.yaml", store=options.store), workers=options.workers)
    with tempfile.TemporaryDirectory() as folder:
        between = Path(folder) / "between.csv"
        write_sweep_table(run, between, DIGITS)
        row = between.read_text(encoding="utf-8")
    TABLE.write_text(joined(GRID.read_text(encoding="utf-8"), row), encoding="utf-8")
    print(f"{TABLE.name}: {len(run.done())} designs beside those of {GRID.name}", flush=True)


def joined(grid: str, more: str) -> str:
    """Both tables as one; designs of the second are numbered on."""
    head, *rows = grid.splitlines()
    second, *others = more.splitlines()
    if second != head:
        raise SystemExit(f"{GRID.name} has other columns than the designs solved now; make both anew.")
    at = head.split(",").index("design")
    first = 1 + max(int(row.split(",")[at]) for row in rows)
    for row in others:
        cells = row.split(",")
        cells[at] = str(first + int(cells[at]))
        rows.append(",".join(cells))
    return "\n".join([head, *rows]) + "\n"


if __name__ == "__main__":
    main()
