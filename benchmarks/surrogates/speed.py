"""Evaluations of laws with slopes per second, on one core: compiled, and by the formula in numpy (`ContinuedLaw`).

OMP_NUM_THREADS=1 python -m benchmarks.surrogates.speed        prints, and writes benchmarks/out/surrogate_speed.json

The laws are those that surrogates fit to a bending design of the grid. Other work on the machine makes times longer,
never shorter: the best of several calls counts.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from benchmarks.output import Bar, ratio, time_calls, write
from benchmarks.surrogates.kinds import TABLES, surrogate

from pliant.fem_tables.reading import read_designs_table
from pliant.records.design import Array
from pliant.records.law import Effort, JointLaw
from pliant_plugins.surrogates.continued import ContinuedLaw
from pliant_plugins.surrogates.polynomial.law import PolynomialLaw

POINTS = 100_000
REPEATS = 15
DESIGN = 4
OUTSIDE = 0.5  # of the box's widths, on each side
FEW = (1, 8, 64)
LAWS = ("polynomial, adaptive", "polynomial, study, least squares", "table", "neural")
BARS = {"polynomial, adaptive": 20.0, "neural": 0.5}

Evaluate = Callable[[Array, Array], Effort]


def main() -> None:
    design = read_designs_table(TABLES / "bending_grid.csv")[DESIGN]
    results: dict[str, Any] = {"points": POINTS, "design": dict(design.design.parameters)}
    bars = []
    for name in LAWS:
        built = surrogate(name)
        if built is None:
            print(f"{name}: not installed, left out")
            continue
        law = built.fit_module(design).law
        results[name] = timed(name, law)
        if name in BARS:
            label = f"{name}: evaluations with slopes, one core"
            bars.append(Bar(label, results[name]["inside"]["million_per_s"], BARS[name], "million/s", False))
    name, helical = "polynomial, three axes", read_designs_table(TABLES / "helical_grid.csv")[0]
    results[name] = timed(name, surrogate("polynomial, adaptive").fit_module(helical).law)
    write("surrogate_speed", results, bars)


def timed(name: str, law: JointLaw) -> dict[str, Any]:
    """Return million evaluations per second inside and around the box, ratios to numpy; µs for few points."""
    found: dict[str, Any] = {}
    for place, beyond in (("inside", 0.0), ("around", OUTSIDE)):
        p, u = points(law, beyond, POINTS)
        times = rounds(law.evaluate, p, u, REPEATS)
        found[place] = {"million_per_s": POINTS / min(times) / 1e6}
        line = f"{name}, {place}: {found[place]['million_per_s']:.3g} million/s"
        if isinstance(law, PolynomialLaw):
            former = partial(ContinuedLaw.evaluate, law)
            require_same(law.evaluate(p, u), former(p, u))
            slow = rounds(former, p, u, 3)
            fast = rounds(law.evaluate, p, u, 3)
            found[place] |= {
                "former_million_per_s": POINTS / min(slow) / 1e6,
                "times_former": ratio(slow, fast),
                "times_former_best": min(slow) / min(times),
            }
            line += (
                f"; in numpy {found[place]['former_million_per_s']:.3g}, ratio {min(slow) / min(times):.3g}"
            )
        print(line)
    for count in FEW:
        p, u = points(law, 0.0, count)
        found[f"microseconds_{count}"] = 1e6 * min(rounds(law.evaluate, p, u, 300))
    print(f"{name}: " + ", ".join(f"{found[f'microseconds_{n}']:.3g} µs for {n}" for n in FEW))
    if isinstance(law, PolynomialLaw):
        found["coefficients"] = list(law.coefficients.shape)
    return found


def points(law: JointLaw, beyond: float, count: int) -> tuple[Array, Array]:
    """Return random points of the box, widened by a share of its width on each side."""
    box = np.vstack([law.domain.actuation, law.domain.deformation])
    spread = np.ptp(box, axis=1)
    low, high = box[:, 0] - beyond * spread, box[:, 1] + beyond * spread
    values = np.random.default_rng(0).uniform(low, high, (count, len(box)))
    return np.ascontiguousarray(values[:, 0]), np.ascontiguousarray(values[:, 1:])


def rounds(evaluate: Evaluate, p: Array, u: Array, count: int) -> list[float]:
    """Return seconds of each of `count` calls, after one warm-up call."""
    evaluate(p, u)
    return time_calls(lambda: evaluate(p, u), count, time.perf_counter)


def require_same(found: Effort, wanted: Effort) -> None:
    """Stop where the two ways disagree by more than rounding."""
    for name in ("tau", "dtau_dp", "dtau_du"):
        values = getattr(wanted, name)
        missed = np.abs(getattr(found, name) - values).max() / np.abs(values).max()
        if missed > 1e-13:
            raise SystemExit(f"{name} differs from the former formula by {missed:.2g} of its largest value")


if __name__ == "__main__":
    main()
