"""Wall time of the two published design grids through `pliant fem`: python -m benchmarks.families.sweep

    python -m benchmarks.families.sweep --only bending
    python -m benchmarks.families.sweep --only helical --designs 4     a part, extrapolated and labelled so

Bending: r {2.75, 3.5, 4.25, 5}, R {6.75, 7.5, 8.25, 9}, l {9, 10, 11, 12}, t 1.5 mm, those that the family builds (the
study counts 54 designs, its table 55). Helical: R {5 … 7}, l {4 … 6}, r 3, t 1.5 mm on three axes. Two workers, every
state of the default sampling, an empty store. A part takes designs evenly from the grid. Each grid has a bar on the
wall time, and every possible design must be done. Writes benchmarks/out/sweep.json.
"""

from __future__ import annotations

import os
import sys
import tempfile
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.output import make_parser, read, write

from pliant import api
from pliant.errors import InvalidDesignError, UserError
from pliant_designs.sweep import SweepRun
from pliant_designs.sweep_designs import sweep_designs

WORKERS = 2
MATERIAL = "material: {kind: neo_hookean, shear_modulus: 240 kPa, density: 1150 kg/m^3}\n"


@dataclass(frozen=True)
class Grid:
    """A published grid: the study, its sweep, how many designs it should have, the bar on its wall time."""

    study: str
    sweep: str
    published: int
    bar_s: float


GRIDS = {
    "bending": Grid(
        "family: {kind: bellow_bending, inner_radius: 3.5 mm, average_radius: 7.5 mm, wall: 1.5 mm, "
        "module_length: 10 mm}\n" + MATERIAL + "fem: {kind: skfem, pressure_max: 15 kPa}\n",
        "{inner_radius: [2.75 mm, 3.5 mm, 4.25 mm, 5 mm], average_radius: [6.75 mm, 7.5 mm, 8.25 mm, 9 mm], "
        "module_length: [9 mm, 10 mm, 11 mm, 12 mm]}",
        54,
        12 * 60.0,
    ),
    "helical": Grid(
        "family: {kind: bellow_helical, inner_radius: 3 mm, average_radius: 6 mm, wall: 1.5 mm, "
        "module_length: 5 mm}\n"
        + MATERIAL
        + "fem: {kind: skfem, pressure_max: 15 kPa, self_contact: pass}\n",
        "{average_radius: [5 mm, 5.5 mm, 6 mm, 6.5 mm, 7 mm], "
        "module_length: [4 mm, 4.5 mm, 5 mm, 5.5 mm, 6 mm]}",
        24,
        20 * 60.0,
    ),
}


def measure(name: str, designs: int | None, workers: int) -> dict[str, Any]:
    """Solve a grid, or a part of it, in an empty store."""
    grid = GRIDS[name]
    with tempfile.TemporaryDirectory() as folder:
        study = Path(folder) / "grid.yaml"
        study.write_text(f"pliant: 1\nname: {name}-grid\n{grid.study}sweep: {grid.sweep}\n", encoding="utf-8")
        opened = api.open_study(study, store=Path(folder) / "store")
        possible = []  # the swept parameters of the designs that the family builds
        for design in sweep_designs(opened.study):
            with suppress(InvalidDesignError):
                opened.context.build("family", design.family)
                possible.append(dict(design.changes))
        if designs is not None and designs < len(possible):
            chosen = np.linspace(0, len(possible) - 1, designs).round().astype(int)
            lines = [",".join(possible[0]), *(",".join(map(repr, possible[i].values())) for i in chosen)]
            (Path(folder) / "part.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
            study.write_text(f"pliant: 1\nname: part\n{grid.study}sweep: {{designs: part.csv}}\n", "utf-8")
            opened = api.open_study(study, store=Path(folder) / "store")
        return _result(name, api.sweep(opened, workers=workers), len(possible), workers)


def _result(name: str, run: SweepRun, possible: int, workers: int) -> dict[str, Any]:
    grid, done, failed = GRIDS[name], run.done(), run.failed()
    solved = len(done) + len(failed)
    whole = solved == possible
    grid_s = run.wall_s * possible / max(solved, 1)
    return {
        "grid": name,
        "designs_published": grid.published,
        "designs_possible": possible,
        "designs_solved": solved,
        "designs_done": len(done),
        "designs_failed": {str(o.design.changes): f"{o.status}: {o.cause}" for o in failed},
        "states": sum(o.n_states for o in done),
        "states_per_design": float(np.mean([o.n_states for o in done])) if done else None,
        "states_failed": sum(o.n_failed for o in done),
        "self_contact": sum(o.self_contact for o in done),
        "workers": workers,
        "wall_s": run.wall_s,
        "whole_grid": whole,
        "grid_wall_s" if whole else "grid_wall_s_extrapolated_from_a_part": grid_s,
        "bar_s": grid.bar_s,
        "met": (grid_s <= grid.bar_s and not failed) if whole else None,
        "load_1_min": os.getloadavg()[0],
    }


def _say(result: dict[str, Any]) -> None:
    print(
        f"{result['grid']}: {result['designs_done']} of {result['designs_solved']} designs done, "
        f"{len(result['designs_failed'])} failed ({result['designs_possible']} possible, "
        f"{result['designs_published']} published), {result['states_per_design'] or 0:.1f} states each, "
        f"{result['wall_s']:.0f} s with {result['workers']} workers (load {result['load_1_min']:.1f})"
    )
    if result["whole_grid"]:
        verdict = "met" if result["met"] else "MISSED"
        print(
            f"bar: {result['grid']} grid: {result['grid_wall_s']:.0f} s (at most {result['bar_s']:g}): {verdict}"
        )
    else:
        grid_s = result["grid_wall_s_extrapolated_from_a_part"]
        print(f"EXTRAPOLATED to the grid: {grid_s:.0f} s (bar {result['bar_s']:g} s); no verdict from a part")
    for design, cause in result["designs_failed"].items():
        print(f"  failed {design}: {cause}")


def main() -> int:
    parser = make_parser(__doc__)
    parser.add_argument("--only", choices=list(GRIDS))
    parser.add_argument("--designs", type=int, help="so many designs of the grid, evenly chosen")
    parser.add_argument("--workers", type=int, default=WORKERS)
    arguments = parser.parse_args()
    if arguments.designs is not None and arguments.designs < 1:
        parser.error("--designs needs at least 1")
    results, missed = read("sweep"), False
    for name in GRIDS:
        if arguments.only not in (None, name):
            continue
        try:
            result = measure(name, arguments.designs, arguments.workers)
        except UserError as error:
            print(f"{name}: not measured: {error}")
            continue
        _say(result)
        results[name if result["whole_grid"] else f"{name}_part"] = result
        missed |= result["met"] is False
        write("sweep", results)
    return int(missed)


if __name__ == "__main__":
    sys.exit(main())
