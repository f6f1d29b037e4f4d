"""Solve the designs behind the gripper's meta-model:

    python examples/gripper_codesign/make.py [--store DIR] [--workers N]

writes gripper_grid.csv, the table that gripper.yaml reads. Designs in the store are not solved again. With --designs
only fem/gripper_grid_designs.csv is written anew: which designs there are.
"""

from __future__ import annotations

import argparse
import itertools
from pathlib import Path

import numpy as np
from scipy.stats import qmc

from pliant import api
from pliant_designs.sweep_table import write_sweep_table

HERE = Path(__file__).parent
NAME = "gripper_grid"
DESIGNS = HERE / "fem" / f"{NAME}_designs.csv"
# mm: r, R, l as the published study bounds them, and the wall with its tolerance.
NAMES = ("inner_radius", "average_radius", "module_length", "wall")
LOW, HIGH = np.array([2.0, 6.0, 8.0, 1.4]), np.array([4.0, 8.0, 12.0, 1.6])
COUNT, SEED = 90, 8
DIGITS = 9
Row = tuple[float, ...]


def can_be_built(row: Row) -> bool:
    """Room for the bellow's arcs."""
    r, R, length, _ = row
    return R - r >= length / 4 - 1e-9


def corners() -> list[Row]:
    """The corners of the box that can be built, and those where the arcs' room cuts it."""
    box = [(float(low), float(high)) for low, high in zip(LOW[:3], HIGH[:3], strict=True)]
    bodies = [(*body,) for body in itertools.product(*box)]
    # r, R or l on an edge of the box such that R − r = l/4.
    bodies += [(3.0, 6.0, 12.0), (4.0, 7.0, 12.0)]
    rows = [(*body, float(wall)) for body in bodies for wall in (LOW[3], HIGH[3])]
    return [row for row in rows if can_be_built(row)]


def designs() -> list[Row]:
    """COUNT designs in mm: the corners, then points of a Sobol sequence that can be built."""
    rows = corners()
    points = LOW + (HIGH - LOW) * qmc.Sobol(4, seed=SEED).random(4 * 64)
    inside = [tuple(round(float(value), 3) for value in point) for point in points]
    rows += [row for row in inside if can_be_built(row)][: COUNT - len(rows)]
    return rows


def designs_text() -> str:
    """The table of designs."""
    lines = [",".join(NAMES), *(",".join(f"{value:g} mm" for value in row) for row in designs())]
    return "\n".join(lines) + "\n"


def solve(store: Path, workers: int | None) -> None:
    """Solve the sweep and write its table."""
    run = api.sweep(api.open_study(HERE / "fem" / f"{NAME}.yaml", store=store), workers=workers)
    write_sweep_table(run, HERE / f"{NAME}.csv", DIGITS)
    print(f"{NAME}: {len(run.done())} designs, {sum(o.n_states for o in run.done())} states", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--designs", action="store_true", help="write the table of designs, solve nothing")
    parser.add_argument("--store", type=Path, default=Path(".pliant/store"))
    parser.add_argument("--workers", type=int, default=None)
    options = parser.parse_args()
    if options.designs:
        DESIGNS.write_text(designs_text(), encoding="utf-8")
        return
    solve(options.store, options.workers)


if __name__ == "__main__":
    main()
