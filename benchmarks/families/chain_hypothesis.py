"""The chain hypothesis: a full FEM of 1 to 8 bending modules against the chain of single-module laws.

    python -m benchmarks.families.chain_hypothesis [--modules 1 2 3 4 6 8] [--picture FILE]

The body is clamped all over its base section and closed by a plate of rubber at its end; the chain's joints have
the law of one module with mirror planes at both ends, fitted to FEM on the same mesh with the same material. Both
are loaded by the same pressure and the same dead force at the tip, without weight. For every case the tip's error is
split, one idealisation after the other, into what comes from

    ends       modules at the clamp and at the cap that bend by less than the law says
    inside     modules between them: law against FEM under the same moment, and the fit's own error
    stretch    links that keep their length, where the plate stretches and shears

by putting the FEM's own turns into the chain's joints, first those of the first and last module, then all, and at last
the stretch of a free module's plate into the links.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.output import make_parser, write

from pliant import api
from pliant.config.study import Study
from pliant.pipeline.study import build_study_chain
from pliant.pipeline.workbench import RunContext
from pliant.records.design import Array
from pliant.records.rollout import Inputs
from pliant.records.structure import StructureState

STUDY = """
pliant: 1
name: chain-hypothesis
family: {kind: bellow_bending, inner_radius: 2 mm, average_radius: 6 mm, wall: 1.5 mm, module_length: 11 mm}
material: {kind: neo_hookean, shear_modulus: 249 kPa}
fem: {kind: skfem, pressure_max: 15 kPa}
surrogate: {kind: polynomial}
chain: {modules: 1, gravity: [0, 0, 0]}
physics: {kind: quasistatic}
task: {kind: free_bending, pressure: 15 kPa}
"""
# Pressure (Pa) and tip force (N) in the body's frame: z points away from the side to which pressure bends.
CASES = (
    (5e3, (0.0, 0.0, 0.0)),
    (10e3, (0.0, 0.0, 0.0)),
    (15e3, (0.0, 0.0, 0.0)),
    (10e3, (0.0, 0.0, 0.05)),
    (10e3, (0.0, 0.0, -0.05)),
)
TO_WORLD = np.array([[0.0, 0.0, -1.0], [0.0, -1.0, 0.0], [-1.0, 0.0, 0.0]])  # body frame → default base pose


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("--modules", type=int, nargs="+", default=[1, 2, 3, 4, 6, 8])
    parser.add_argument("--picture", type=Path, default=None)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        study = Path(folder) / "study.yaml"
        study.write_text(STUDY)
        rows = []
        for modules in given.modules:
            opened = api.open_study(study, [f"chain.modules={modules}"], store=Path(folder) / "store")
            rows += solved(opened.context, opened.study, modules)
    write("chain_hypothesis", {"cases": rows})
    if given.picture:
        draw(rows, given.picture)


def solved(context: RunContext, study: Study, modules: int) -> list[dict[str, Any]]:
    """Solve all cases of one number of modules."""
    begun = time.perf_counter()
    family, backend, material, engine = (
        context.build(name, getattr(study, name)) for name in ("family", "fem", "material", "physics")
    )
    body, chain = (
        backend.structure(family.structure(modules), material),
        build_study_chain(context, study).chain,
    )
    rows, free = [], {0.0: body.rest()}
    # Axial strain of a free module's plate at each pressure.
    solver, stretch = backend.solver(family.problem(), material), {}
    state = solver.rest()
    for pressure in sorted({pressure for pressure, _ in CASES}):
        state = solver.free(pressure, state)
        stretch[pressure] = state.axial_strain
    for pressure, force in CASES:
        start = free.get(pressure) or free[max(p for p in free if p <= pressure)]
        state = body.equilibrium(pressure, np.array(force), start)
        if not any(force):
            free[pressure] = state
        with engine.build(chain) as simulation:
            simulation.apply(Inputs({"pressure_pa": pressure}, tip_force_n=TO_WORLD @ np.array(force)))
            settled = simulation.settle()
        rows.append(compared(family.module_length_m, state, settled.joint_angles[:, 0], stretch[pressure]))
        print(sentence(rows[-1]), flush=True)
    print(f"  {modules} modules: {time.perf_counter() - begun:.0f} s", flush=True)
    return rows


def compared(length: float, state: StructureState, angles: Array, strain: float) -> dict[str, Any]:
    """Return the chain's error and its parts; lengths in m, angles in rad."""
    turns, modules = np.diff(state.turns_rad), len(angles)
    ends = [0, modules - 1]
    mixed = angles.copy()
    mixed[ends] = turns[ends]
    tip = state.markers_m[-1, [0, 2]]
    steps = [planar_tip(length, bend) for bend in (angles, mixed, turns)]
    steps.append(planar_tip((1 + strain) * length, turns))
    errors = [float(np.linalg.norm(place - tip)) for place in steps]
    reach = [float(np.linalg.norm(place)) for place in (steps[2], tip)]
    inner = slice(1, -1) if modules > 2 else slice(0, 0)
    return {
        "modules": modules,
        "pressure_pa": state.pressure_pa,
        "tip_force_n": state.tip_force_n.tolist(),
        "turn_fem_rad": float(turns.sum()),
        "turn_chain_rad": float(angles.sum()),
        "turns_fem_rad": turns.tolist(),
        "angles_chain_rad": angles.tolist(),
        "tip_error_m": errors[0],
        "tip_error_of_length": errors[0] / (modules * length),
        "tip_error_ends_right_m": errors[1],
        "tip_error_turns_right_m": errors[2],
        "tip_error_stretched_m": errors[3],
        "too_short_m": reach[1] - reach[0],
        "plate_strain": strain,
        "inner_turn_error": float(np.mean(angles[inner] / turns[inner] - 1)) if modules > 2 else None,
        "missing_at_ends_modules": float(np.sum(1 - turns[ends] / angles[ends])) if modules > 1 else None,
        "wall_s": state.wall_s,
    }


def planar_tip(length: float, angles: Array) -> Array:
    """Return (x, z) of the tip of links l/2, l, …, l, l/2 that turn toward −z."""
    links = length * np.concatenate([[0.5], np.ones(len(angles) - 1), [0.5]])
    heading = np.concatenate([[0.0], np.cumsum(angles)])
    return np.array([np.sum(links * np.cos(heading)), -np.sum(links * np.sin(heading))])


def sentence(row: dict[str, Any]) -> str:
    error = row["inner_turn_error"]
    inner = "" if error is None else f", inner modules {100 * error:+.2f} %"
    mm = {name: 1e3 * value for name, value in row.items() if name.endswith("_m")}
    return (
        f"N {row['modules']}, {row['pressure_pa'] / 1e3:g} kPa, tip force z {row['tip_force_n'][2]:+.2f} N: turn FEM "
        f"{np.degrees(row['turn_fem_rad']):.2f}°, chain {np.degrees(row['turn_chain_rad']):.2f}°{inner}; tip error "
        f"{mm['tip_error_m']:.2f} mm ({100 * row['tip_error_of_length']:.1f} % of length), with the end modules' turns "
        f"{mm['tip_error_ends_right_m']:.2f}, with all {mm['tip_error_turns_right_m']:.2f} (too short by "
        f"{mm['too_short_m']:.2f}), with links stretched by {100 * row['plate_strain']:.2f} % "
        f"{mm['tip_error_stretched_m']:.2f}"
    )


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    """Draw errors over the number of modules."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, (left, right) = pyplot.subplots(1, 2, figsize=(9.5, 3.8), layout="constrained")
    for pressure, force in CASES:
        here = [r for r in rows if r["pressure_pa"] == pressure and tuple(r["tip_force_n"]) == force]
        n = [r["modules"] for r in here]
        label = f"{pressure / 1e3:g} kPa" + (f", {force[2]:+g} N at the tip" if any(force) else "")
        style = "o-" if not any(force) else "s--"
        missing = [r["turn_chain_rad"] - r["turn_fem_rad"] for r in here]
        (line,) = left.plot(n, np.degrees(missing), style, label=label, markersize=4)
        share = [100 * r["tip_error_of_length"] for r in here]
        right.plot(n, share, style, color=line.get_color(), markersize=4)
        rest = [100 * r["tip_error_turns_right_m"] / (r["modules"] * 11e-3) for r in here]
        right.plot(n, rest, ":", color=line.get_color(), linewidth=1)
    left.axhline(0, color="0.7", linewidth=0.8)
    left.set(xlabel="modules", ylabel="tip's turn, chain − FEM (°)")
    left.legend(fontsize=8, frameon=False)
    right.set(
        xlabel="modules", ylabel="tip error (% of length)\ndotted: with the FEM's turns", ylim=(0, None)
    )
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    main()
