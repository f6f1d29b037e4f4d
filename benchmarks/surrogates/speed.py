"""Evaluations of laws with slopes per second, on one core: compiled, and as the law stood in numpy.

OMP_NUM_THREADS=1 python -m benchmarks.surrogates.speed        prints, and writes benchmarks/out/surrogate_speed.json

The laws are those that surrogates fit to a bending design of the grid. Other work on the machine makes times longer,
never shorter: the best of several calls counts.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from benchmarks.output import Bar, ratio, seconds_of, write
from benchmarks.surrogates.kinds import bending_designs, helical_designs, surrogate

from pliant.records.design import Array
from pliant.records.law import Effort, JointLaw
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
    """Time all laws inside their box and around it."""
    design = bending_designs()[DESIGN]
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
    built = surrogate("polynomial, adaptive")
    assert built is not None
    results["polynomial, three axes"] = timed(
        "polynomial, three axes", built.fit_module(helical_designs()[0]).law
    )
    write("surrogate_speed", results, bars)


def timed(name: str, law: JointLaw) -> dict[str, Any]:
    """Million evaluations a second inside and around the box, with ratios to numpy; microseconds for few points."""
    found: dict[str, Any] = {}
    for place, beyond in (("inside", 0.0), ("around", OUTSIDE)):
        p, u = points(law, beyond, POINTS)
        times = rounds(law.evaluate, p, u, REPEATS)
        found[place] = {"million_per_s": POINTS / min(times) / 1e6}
        line = f"{name}, {place}: {found[place]['million_per_s']:.3g} million/s"
        if isinstance(law, PolynomialLaw):
            former = Former(law)
            require_same(law.evaluate(p, u), former.evaluate(p, u))
            slow = rounds(former.evaluate, p, u, 3)
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
    """Random points of the box, made wider by a share of its width on each side."""
    box = np.vstack([law.domain.actuation, law.domain.deformation])
    spread = np.ptp(box, axis=1)
    low, high = box[:, 0] - beyond * spread, box[:, 1] + beyond * spread
    values = np.random.default_rng(0).uniform(low, high, (count, len(box)))
    return np.ascontiguousarray(values[:, 0]), np.ascontiguousarray(values[:, 1:])


def rounds(evaluate: Evaluate, p: Array, u: Array, count: int) -> list[float]:
    """Seconds of each of `count` calls, after one that is not counted."""
    evaluate(p, u)
    return seconds_of(lambda: evaluate(p, u), count, time.perf_counter)


def require_same(found: Effort, wanted: Effort) -> None:
    """Stop where the two ways disagree by more than rounding."""
    for name in ("tau", "dtau_dp", "dtau_du"):
        values = getattr(wanted, name)
        missed = np.abs(getattr(found, name) - values).max() / np.abs(values).max()
        if missed > 1e-13:
            raise SystemExit(f"{name} differs from the former formula by {missed:.2g} of its largest value")


class Former:
    """The named baseline: `PolynomialLaw.evaluate` as it stood before it was compiled, in numpy."""

    def __init__(self, law: PolynomialLaw) -> None:
        self.law = law
        c = law.coefficients
        plain = np.pad(c, ((0, 0), (0, 2)))
        plain[0, -2] = law.odd
        in_u = np.zeros_like(plain)
        in_u[:, : c.shape[1] - 1] = c[:, 1:] * np.arange(1, c.shape[1]) / law.deformation_map[1]
        in_u[0, -1] = 2 * law.odd
        self.table = np.concatenate([plain, self._in_x(plain), in_u, self._in_x(in_u)], axis=1)

    def _in_x(self, table: Array) -> Array:
        slope = np.zeros_like(table)
        slope[:-1] = table[1:] * np.arange(1, len(table))[:, None] / self.law.actuation_map[1]
        return slope

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        """As the law's."""
        law, p, u = self.law, actuation, deformation[:, 0]
        held_u = np.minimum(np.maximum(u, law.domain.deformation[0, 0]), law.domain.deformation[0, 1])
        held_p = np.minimum(np.maximum(p, law.domain.actuation[0]), law.domain.actuation[1])
        tau, gain, slope, cross = self._polynomials(held_p, held_u).T
        dp, du = p - held_p, u - held_u
        if dp.any():
            reach, rate, reference = law._saturate(dp)
            tau = tau + reach * gain + (dp - reach) * reference
            gain = rate * gain + (1 - rate) * reference
            slope = slope + reach * cross
            cross = rate * cross
        tau, gain = tau + slope * du, gain + cross * du
        return Effort(tau[:, None], gain[:, None], slope[:, None, None])

    def _polynomials(self, p: Array, u: Array) -> Array:
        law = self.law
        x = (p - law.actuation_map[0]) / law.actuation_map[1]
        v = (u - law.deformation_map[0]) / law.deformation_map[1]
        columns = np.empty((len(u), law.coefficients.shape[1] + 2))
        columns[:, :-2] = np.vander(v, law.coefficients.shape[1], increasing=True)
        columns[:, -1] = np.abs(u)
        columns[:, -2] = u * columns[:, -1]
        rows = np.vander(x, len(law.coefficients), increasing=True) @ self.table
        result: Array = np.einsum("nkj,nj->nk", rows.reshape(len(u), 4, -1), columns)
        return result


if __name__ == "__main__":
    main()
