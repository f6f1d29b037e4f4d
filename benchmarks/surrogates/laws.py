"""Laws of one design by kind of surrogate: errors on states left out, and whether their error bars hold.

OMP_NUM_THREADS=1 python -m benchmarks.surrogates.laws        prints, and writes benchmarks/out/surrogate_laws.json
    --kinds polynomial table      only surrogates of these kinds

Every state of role "check" is scored; no fit has seen it. The error bar of polynomials was chosen on every other
design of the grid, from the first; the designs between are what it is judged on.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from benchmarks.output import Bar, make_parser, write
from benchmarks.surrogates.kinds import FORMS, TABLES, surrogate

from pliant.errors import UserError
from pliant.fem_tables.reading import read_designs_table, read_module_table
from pliant.interfaces.surrogate import Surrogate
from pliant.records.fem import ModuleData
from pliant.records.law import JointLaw
from pliant_plugins.surrogates.polynomial.states import split

LEVELS = (0.5, 0.9, 0.99)
WORST = 0.005
COVERED = (0.85, 0.95)
PUBLISHED = 0.0826


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("--kinds", nargs="+", default=sorted({kind for kind, _ in FORMS.values()}))
    wanted = parser.parse_args().kinds
    reference = read_module_table(TABLES.parent / "data/bellow_bending.csv")
    grid = read_designs_table(TABLES / "bending_grid.csv")
    print(f"worst error of the torque range on states left out; published {100 * PUBLISHED:.3g} %")
    results: dict[str, Any] = {"published_worst_of_range": PUBLISHED, "designs": len(grid)}
    for name, (kind, _) in FORMS.items():
        if kind not in wanted:
            continue
        built = surrogate(name)
        if built is None:
            print(f"{name}: not installed, left out")
            continue
        results[name] = surrogate_figures(built, reference, grid)
        print(f"{name}\n{told(results[name])}")
    bars = promised(results.get("polynomial, adaptive"))
    write("surrogate_laws", results, bars)


def surrogate_figures(built: Surrogate, reference: ModuleData, grid: Sequence[ModuleData]) -> dict[str, Any]:
    """Return figures of one surrogate."""
    rows = [scored(built, design) for design in grid]
    fitted = [row for row in rows if "problem" not in row]
    problems = [row["problem"] for row in rows if "problem" in row]
    found: dict[str, Any] = {"reference": scored(built, reference), "grid": rows}
    found |= {"fitted": len(fitted), "problems": problems}
    if fitted:
        for name in ("worst_of_range", "rmse_of_range"):
            values = [row[name] for row in fitted]
            found[name] = {"median": float(np.median(values)), "worst": float(max(values))}
        found["r2"] = min(row["r2"] for row in fitted)
    for half, start in (("chosen_on", 0), ("judged_on", 1)):
        found[half] = shares([row for row in rows[start::2] if row.get("inside")])
    return found


def scored(built: Surrogate, design: ModuleData) -> dict[str, Any]:
    """Return errors of one design's law on its check states and which of them are inside its bands."""
    try:
        fitted = built.fit_module(design)
    except UserError as error:
        return {"problem": str(error)}
    report = fitted.report
    states = split(design.axis(design.main_axis))
    row = {name: getattr(report, name) for name in ("worst_of_range", "r2", "n_fitted", "n_heldout")}
    row["rmse_of_range"] = report.rmse / report.effort_range
    p, u = states.check.actuation, states.check.angle_rad
    inside = inside_bands(fitted.law, p, u, states.check.moment_n_m)
    if inside is not None:
        width = fitted.law.band(p, u[:, None], 0.9)
        row |= {"inside": inside, "half_width_of_range": float(width.mean()) / float(states.ranges[0])}
    return row


def inside_bands(law: JointLaw, p: np.ndarray, u: np.ndarray, tau: np.ndarray) -> list[list[bool]] | None:
    """Return, for each level, whether each state is within the law's band; None if the law has no error bar."""
    missed = np.abs(law.evaluate(p, u[:, None]).tau[:, 0] - tau)
    bands = [law.band(p, u[:, None], level) for level in LEVELS]
    return [(missed <= band[:, 0]).tolist() for band in bands if band is not None] or None


def shares(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Share of the states of several designs inside each band."""
    if not rows:
        return {}
    inside = np.concatenate([np.array(row["inside"]) for row in rows], axis=1)
    return {
        "designs": len(rows),
        "states": inside.shape[1],
        "covered": dict(zip(map(str, LEVELS), inside.mean(axis=1).tolist(), strict=True)),
        "median_half_width_of_range": float(np.median([row["half_width_of_range"] for row in rows])),
    }


def told(found: dict[str, Any]) -> str:
    """Return the lines of one surrogate."""
    one = found["reference"]
    reached = one.get("problem") or f"worst {100 * one['worst_of_range']:.3g} %, R² {one['r2']:.8f}"
    lines = [f"  reference design: {reached}"]
    if found["fitted"]:
        worst = found["worst_of_range"]
        lines.append(
            f"  {found['fitted']} designs: worst {100 * worst['worst']:.3g} %, median of the designs' worst "
            f"{100 * worst['median']:.3g} %, lowest R² {found['r2']:.8f}"
        )
    if found["problems"]:
        lines.append(f"  {len(found['problems'])} designs not fitted: {found['problems'][0]}")
    for half in ("chosen_on", "judged_on"):
        if found[half]:
            covered = found[half]["covered"].items()
            cells = ", ".join(
                f"{100 * float(level):g} % band {100 * share:.3g} %" for level, share in covered
            )
            lines.append(f"  {half.replace('_', ' ')} {found[half]['states']} states: {cells}")
    return "\n".join(lines)


def promised(adaptive: dict[str, Any] | None) -> list[Bar]:
    """Return the bars of the adaptive polynomial."""
    if adaptive is None:
        return []
    covered = adaptive["judged_on"]["covered"]["0.9"]
    worst = max(adaptive["worst_of_range"]["worst"], adaptive["reference"]["worst_of_range"])
    return [
        Bar("bending laws, worst error on states left out", 100 * worst, 100 * WORST, "% of range", True),
        Bar("share of states inside the 90 % band", 100 * covered, 100 * COVERED[0], "%", False),
        Bar("share of states inside the 90 % band", 100 * covered, 100 * COVERED[1], "%", True),
    ]


if __name__ == "__main__":
    main()
