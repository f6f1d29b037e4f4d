"""Number of designs needed if each one is chosen by expected gain: python -m benchmarks.surrogates.gain

    python -m benchmarks.surrogates.gain --only bending --seeds 10

Starts from a few spread designs of the grid and adds one at a time: the one of the largest `DesignLaws.gain` over the
range of designs, from the designs still unsolved. After every design the model is fitted again and scored on the test
table, whose designs lie between those of the grid and are never fitted. Compared with random choice, designs far from
each other, and the error of the full grid. The bar: the full grid's error with at most half its designs. Writes
benchmarks/out/gain_GRID.json.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from benchmarks.output import Bar, make_parser, write
from benchmarks.surrogates.kinds import design_misses, table
from scipy.stats import qmc

from pliant.records.design import Array
from pliant_designs.cross_validation import shares
from pliant_designs.meta_model import DesignLaws
from pliant_designs.meta_models.config import RegressionConfig
from pliant_designs.meta_models.regression import Regression
from pliant_designs.records import SolvedDesigns

OVER = 256
SEED = 0
# Target errors relative to the full grid's.
FACTORS = (1.0, 1.1, 1.5)


def error(laws: DesignLaws, test: SolvedDesigns) -> float:
    """Return the RMS torque error on unseen designs, as a share of each design's range; all axes."""
    misses = design_misses(laws, test)
    share = shares(misses)[misses.counts]
    return float(np.sqrt(np.nanmean(share**2)))


def fitted(designs: SolvedDesigns, chosen: list[int]) -> DesignLaws:
    """Return the model of the chosen designs."""
    keep = np.zeros(len(designs), bool)
    keep[chosen] = True
    return Regression(RegressionConfig()).fit(designs.rows(keep)).laws


def spread(designs: SolvedDesigns, count: int) -> list[int]:
    """Return designs far from each other: the one nearest to the middle, then each farthest from those chosen."""
    places = (designs.values - designs.box[:, 0]) / designs.scale
    chosen = [int(np.argmin(np.sum((places - 0.5) ** 2, axis=1)))]
    while len(chosen) < count:
        apart = np.min(np.sum((places[:, None] - places[chosen][None]) ** 2, axis=2), axis=1)
        chosen.append(int(np.argmax(apart)))
    return chosen


def by_gain(
    designs: SolvedDesigns, test: SolvedDesigns, start: list[int], most: int
) -> list[tuple[int, float]]:
    """Return (designs, error) as designs are added by expected gain over the family's range."""
    over = _range(designs)
    chosen, curve = list(start), []
    while True:
        laws = fitted(designs, chosen)
        curve.append((len(chosen), error(laws, test)))
        print(f"    gain: {curve[-1][0]} designs, {100 * curve[-1][1]:.4f} % of range", flush=True)
        if len(chosen) >= most:
            return curve
        left = np.setdiff1d(np.arange(len(designs)), chosen)
        gain = laws.gain(designs.values[left], over)
        chosen.append(int(left[np.argmax(gain)]))


def _range(designs: SolvedDesigns) -> Array:
    """Return designs over which the error is averaged: even over the hull of feasible ones."""
    points = qmc.scale(qmc.Sobol(len(designs.names), seed=SEED).random(OVER), *designs.box.T)
    places = (points - designs.box[:, 0]) / designs.scale
    grid = (designs.values - designs.box[:, 0]) / designs.scale
    near = np.min(np.max(np.abs(places[:, None] - grid[None]), axis=2), axis=1)
    steps = [np.diff(np.unique(np.round(column, 9))).max() for column in grid.T]
    return points[near <= max(steps) / 2 + 1e-9]


def study(grid: str, seeds: int, counts: list[int]) -> None:
    """Run both strategies on one grid."""
    solved, test = table(f"{grid}_grid"), table(f"{grid}_test")
    full = error(fitted(solved, list(range(len(solved)))), test)
    print(f"{grid}: full grid of {len(solved)} designs, {100 * full:.4f} % of range on {len(test)} others")
    start = spread(solved, len(solved.names) + 2)
    curve = by_gain(solved, test, start, max(counts))
    evenly = {count: error(fitted(solved, spread(solved, count)), test) for count in counts}
    orders = [np.random.default_rng(seed).permutation(len(solved)).tolist() for seed in range(seeds)]
    random = np.array([[error(fitted(solved, order[:n]), test) for n in counts] for order in orders])
    for count, column in zip(counts, random.T, strict=True):
        chosen = dict(curve)[count]
        low, middle, high = (100 * np.quantile(column, q) for q in (0.1, 0.5, 0.9))
        print(
            f"  {count:3d} designs: gain {100 * chosen:.4f} %, "
            f"spread {100 * evenly[count]:.4f} %, random {middle:.4f} % ({low:.4f}–{high:.4f})"
        )
    bars = []
    for factor in FACTORS:
        below = [float(count) for count, found in curve if found <= factor * full]
        print(f"  error of the full grid × {factor}: {min(below, default='not reached')} designs")
        what = f"{grid}: designs by gain for the full grid's error × {factor}"
        bars.append(Bar(what, min(below, default=np.inf) / len(solved), 0.5, "of them", True))
    results: dict[str, Any] = {
        "full": {"designs": len(solved), "error": full},
        "gain": curve,
        "spread": {"counts": counts, "errors": [evenly[count] for count in counts]},
        "random": {"counts": counts, "errors": random.tolist()},
    }
    write(f"gain_{grid}", results, bars)


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("--only", choices=["bending", "helical"])
    parser.add_argument("--seeds", type=int, default=10)
    asked = parser.parse_args()
    if asked.only in (None, "bending"):
        study("bending", asked.seeds, [14, 28])
    if asked.only in (None, "helical"):
        study("helical", asked.seeds, [6, 8, 10, 12])


if __name__ == "__main__":
    main()
