"""Mesh and element study of the families' FEM: python -m benchmarks.families.elements [FAMILY ...] [--refinement 2]

For each family (bellow_bending where none is named) and each refinement 1 … N, the three elements of `skfem`: cell
(mean dilatation), continuous (Taylor–Hood), point (plain displacement). Free motion of the main axis at a third, two
thirds and all of the largest actuation; effort that keeps it at zero there, and at half the free motion at the end.
Every figure relative to the finest mesh's Taylor–Hood cells, with unknowns, Newton steps and CPU seconds.

Prints the table and writes benchmarks/out/elements.json.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from benchmarks.families.published_y import make_solver
from benchmarks.output import Bar, make_parser, write

from pliant.interfaces.family import ActuatorFamily
from pliant.records.fem import FemState
from pliant_plugins.manifest import pliant_components

MU_PA = 240e3
LARGEST = {"pressure_pa": 15e3, "tendon_force_n": 2.0}
SHARES = (1 / 3, 2 / 3, 1.0)
ELEMENTS = ("continuous", "cell", "point")


def solve(family: ActuatorFamily, refinement: int, element: str) -> dict[str, Any]:
    """Return free motions (rad or m), efforts (N·m or N), and their cost, by one mesh and element.

    The free branch upwards, then blocked states from rest, then one in between.
    """
    problem = family.problem(refinement)
    solver = make_solver(problem, MU_PA, pressure_max_pa=15e3, dilatation=element)
    levels = [share * LARGEST[problem.actuation] for share in SHARES]
    begun = time.process_time()
    free = _branch(solver.rest(), levels, solver.free)
    blocked = _branch(solver.rest(), levels, lambda a, s: solver.constrained(a, 0.0, s))
    between = solver.constrained(levels[-1], free[-1].angle_rad / 2, free[-1])
    states = [*free, *blocked, between]
    return {
        "refinement": refinement,
        "element": element,
        "free": [state.angle_rad for state in free],
        "blocked": [state.moment_n_m for state in blocked],
        "half_way": between.moment_n_m,
        "unknowns": solver.assembler.pattern.size,
        "newton_steps": sum(state.iterations for state in states),
        "cpu_s": time.process_time() - begun,
    }


def _branch(start: FemState, levels: list[float], step: Any) -> list[FemState]:
    states = [start]
    for level in levels:
        states.append(step(level, states[-1]))
    return states[1:]


def study(kind: str, refinements: int) -> dict[str, Any]:
    """Return figures of all meshes and elements of one family, with their differences from the finest."""
    component = next(c for c in pliant_components() if c.interface == "family" and c.kind == kind)
    # The example of the family's manifest, its reference design.
    family = component.build(
        component.config_model().model_validate({"kind": kind, **component.smallest_block()})
    )
    rows = []
    for refinement in range(1, refinements + 1):
        for element in ELEMENTS:
            rows.append(solve(family, refinement, element))
            end, cpu_s = rows[-1]["free"][-1], rows[-1]["cpu_s"]
            print(f"{kind} {refinement} {element}: free at the end {end:.6g}, {cpu_s:.1f} s", flush=True)
    finest = next(row for row in rows[-len(ELEMENTS) :] if row["element"] == "continuous")
    print(f"{kind}: differences from continuous cells, refinement {refinements}, in %")
    print(
        "refinement element      free 1/3    2/3      1   blocked 1/3  2/3    1   half-way  unknowns steps  CPU s"
    )
    for row in rows:
        for name in ("free", "blocked", "half_way"):
            row[f"{name}_percent"] = (100 * (np.array(row[name]) / np.array(finest[name]) - 1)).tolist()
        shown = (*row["free_percent"], *row["blocked_percent"], row["half_way_percent"])
        print(
            f"{row['refinement']:10d} {row['element']:10s} {' '.join(f'{value:8.3f}' for value in shown)} "
            f"{row['unknowns']:9d} {row['newton_steps']:5d} {row['cpu_s']:6.2f}",
            flush=True,
        )
    return {"levels": list(SHARES), "rows": rows}


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("families", nargs="*", default=["bellow_bending"])
    parser.add_argument("--refinement", type=int, default=2)
    arguments = parser.parse_args()
    results = {kind: study(kind, arguments.refinement) for kind in arguments.families}
    bars = []
    for kind, result in results.items():
        at = {(row["refinement"], row["element"]): row["free"][-1] for row in result["rows"]}
        gap = 100 * abs(at[1, "cell"] / at[1, "continuous"] - 1)
        bars.append(Bar(f"{kind}: cell against continuous, free at the end", gap, 0.3, "%", True))
    write("elements", {"shear_modulus_pa": MU_PA, "families": results}, bars)


if __name__ == "__main__":
    main()
