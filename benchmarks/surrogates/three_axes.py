"""Laws of three axes, coupled and uncoupled, and of the tendon joint: python -m benchmarks.surrogates.three_axes

For every helical design of examples/designs and examples/data: R² and worst of the effort's range on trusted check
states by axis, and on states with several axes deflected, each left out of the fit in turn (they have no check role).
Check states that mirror a fitted state contain no new information and are not counted.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.output import REFERENCE, ROOT, Bar, time_calls, write

from pliant.errors import UserError
from pliant.fem_tables.reading import read_designs_table, read_module_table, read_table
from pliant.records.design import Array
from pliant.records.fem import TRUSTED, ModuleData
from pliant.records.law import JointLaw
from pliant_plugins.surrogates.config import PolynomialConfig
from pliant_plugins.surrogates.polynomial.axes import AXES, fit_each
from pliant_plugins.surrogates.polynomial.states import Mask, effort_ranges
from pliant_plugins.surrogates.polynomial.surrogate import Polynomial

TENDON = REFERENCE / "tendon_joint_fem.csv"
# States are smooth enough for one polynomial where y's, left out, are missed by less than this (RMS).
SMOOTH = 2e-4
Scores = dict[str, tuple[float, float]]


def fresh(data: ModuleData) -> Mask:
    """Return trusted check states that are no mirror image of a fitted state."""
    at = np.column_stack([data.actuation / 1e6, np.abs(data.deformation[:, [0, 2]]), data.deformation[:, 1]])
    fitted = at[data.role == "fit"]
    apart = np.abs(at[:, None] - fitted[None]).max(axis=2).min(axis=1) > 1e-7
    return (data.role == "check") & apart & np.isin(data.status, TRUSTED)


def by_axis(law: JointLaw, data: ModuleData) -> Scores:
    """Return (R², worst of range) of each axis on the check states that explore it."""
    missed, ranges = law.evaluate(data.actuation, data.deformation).tau - data.tau, effort_ranges(data)
    return {
        axis: _scores(missed[own, k], data.tau[own, k], ranges[k])
        for k, axis in enumerate(data.axes)
        if (own := fresh(data) & (data.explored == axis)).sum() > 1
    }


def several_held(law: JointLaw, data: ModuleData) -> float:
    """Return the worst of range of a law on unseen states with several deflected axes."""
    own = (data.explored == "coupling") & (data.role == "fit") & np.isin(data.status, TRUSTED)
    if not own.any():
        return float("nan")
    missed = law.evaluate(data.actuation[own], data.deformation[own]).tau - data.tau[own]
    return float((np.abs(missed) / effort_ranges(data)).max())


def _scores(missed: Array, wanted: Array, effort_range: float) -> tuple[float, float]:
    spread = float(np.sum((wanted - wanted.mean()) ** 2))
    return 1 - float(np.sum(missed**2)) / spread, float(np.abs(missed).max()) / effort_range


def compare(name: str, data: ModuleData) -> dict[str, object]:
    """Fit the law that `polynomial` chooses and three laws by themselves; print their scores in one line."""
    surrogate, begun = Polynomial(PolynomialConfig()), time.process_time()
    fitted = surrogate.fit_module(data)
    cpu_s = time.process_time() - begun
    single = uncoupled(surrogate, data)
    details = fitted.report.details
    together = details["form"] == "energy"
    several = details["left_out_several_of_range"] if together else several_held(fitted.law, data)
    result: dict[str, Any] = {
        "form": details["form"],
        "chosen": by_axis(fitted.law, data),
        "uncoupled": by_axis(single, data) if single else {},
        "chosen_several": several,
        "uncoupled_several": several_held(single, data) if single else float("nan"),
        "left_out": {key: details[key] for key in ("left_out_together", "left_out_apart")},
        "stable": details["stable"],
        "terms": details["terms"],
        "error_bar": details["error_bar"],
        "cpu_s": cpu_s,
        "million_per_s": speed(fitted.law),
    }
    cells = [
        " ".join(f"{axis} {r2:.6f} {worst:.1e}" for axis, (r2, worst) in scores.items())
        for scores in (result["chosen"], result["uncoupled"])
    ]
    print(
        f"{name:>14} {'coupled' if together else 'apart':>7}  {cells[0]}  |  {cells[1]}  |  several held {several:.1e} "
        f"| {result['uncoupled_several']:.1e} | band {details['error_bar']['covered']:.2f} | "
        f"{result['million_per_s']:.1f} M/s, fit {cpu_s:.1f} s{'' if details['stable'] else '  UNSTABLE'}",
        flush=True,
    )
    return result


def uncoupled(surrogate: Polynomial, data: ModuleData) -> JointLaw | None:
    """Fit three independent laws; return None if an axis has too few trusted states."""
    try:
        return fit_each(dict.fromkeys(AXES, surrogate), {a: data.axis(a) for a in AXES}).law
    except UserError:
        return None


def speed(law: JointLaw, n: int = 100_000) -> float:
    """Return million evaluations with slopes per second of processor time on one core, best of five rounds."""
    random, box = np.random.default_rng(0), law.domain
    p = random.uniform(*box.actuation, n)
    u = random.uniform(box.deformation[:, 0], box.deformation[:, 1], (n, len(law.axes)))
    law.evaluate(p, u)
    return n / min(time_calls(lambda: law.evaluate(p, u), 5)) / 1e6


def covered(results: list[dict[str, Any]]) -> tuple[float, int]:
    """Share of the check states' efforts inside the 90 % band, and how many there are."""
    bars = [one["error_bar"] for one in results]
    n = sum(bar["n"] for bar in bars)
    return sum(bar["covered"] * bar["n"] for bar in bars) / n, n


def named(data: ModuleData) -> str:
    own = data.design.parameters
    radius, length = (1e3 * float(own[name]) for name in ("average_radius_m", "module_length_m"))
    return f"R {radius:.2f} l {length:.2f}"


def summary(what: str, results: Mapping[str, Any]) -> dict[str, Any]:
    """Print and return how many designs reach R² > 0.9999 on every axis, the lowest R² and the worst of range."""
    found: dict[str, Any] = {}
    for kind in ("chosen", "uncoupled"):
        known = {name: one[kind] for name, one in results.items() if one[kind]}
        lowest = {name: min(r2 for r2, _ in scores.values()) for name, scores in known.items()}
        worst = {name: max(miss for _, miss in scores.values()) for name, scores in known.items()}
        met = sum(r2 > 0.9999 for r2 in lowest.values())
        extremes = {"lowest": min(lowest.values()), "worst": max(worst.values())}
        found[kind] = {"met": met, "of": len(lowest), **extremes}
        print(
            f"{what}, {kind}: every axis above R² 0.9999 in {met} of {len(lowest)} designs; lowest "
            f"{min(lowest.values()):.6f}, worst {max(worst.values()):.1e} of the range"
        )
    apart = sum(one["form"] != "energy" for one in results.values())
    unstable = sum(not one["stable"] for one in results.values())
    share, n = covered(list(results.values()))
    slowest = min(one["million_per_s"] for one in results.values())
    print(
        f"{what}: apart in {apart}, unstable in {unstable}; {share:.3f} of {n} in the band; slowest {slowest:.2f} M/s"
    )
    found |= {"apart": apart, "unstable": unstable, "covered": share, "n": n}
    return {**found, "slowest_million_per_s": slowest}


def tendon(path: Path) -> tuple[float, float]:
    """Return (R², worst of range) of the tendon joint's law on left-out states."""
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / path.name
        copy.write_text(path.read_text().replace("joint_angle_rad", "angle_rad"))
        report = Polynomial(PolynomialConfig()).fit(read_table(copy)).report
    print(
        f"{path.name}: R² {report.r2:.8f}, worst {report.worst_of_range:.1e} of the range on {report.n_heldout} states"
    )
    return report.r2, report.worst_of_range


def main() -> None:
    top = int(sys.argv[1]) if len(sys.argv) > 1 else None
    print(
        "design: law that polynomial chooses by axis (R², worst of range) | three laws of degree 8 | worst where"
    )
    print("several axes are held | check states in the 90 % band | speed")
    grid = {named(data): data for data in read_designs_table(ROOT / "examples/designs/helical_grid.csv")}
    designs = {"study's": read_module_table(ROOT / "examples/data/bellow_helical.csv"), **grid}
    results = {name: compare(name, data) for name, data in list(designs.items())[:top]}
    print("designs between them, never used to make the method:")
    unseen = {named(data): data for data in read_designs_table(ROOT / "examples/designs/helical_test.csv")}
    tests = {name: compare(name, data) for name, data in list(unseen.items())[:top]}
    totals = {"grid": summary("grid", results), "test": summary("test", tests)}
    odd = covered(list(results.values())[2::2])  # the bar was chosen on the others
    print(f"error bar on every second design: {odd[0]:.3f} of {odd[1]}")
    smooth = {name: one for name, one in results.items() if max(_left_out_y(one)) <= SMOOTH}
    if smooth:
        totals["smooth"] = summary(f"y left out missed by {SMOOTH:.0e} at most", smooth)
    tendons = [tendon(ROOT / "examples/data/tendon_joint.csv")]
    if TENDON.exists():
        tendons.append(tendon(TENDON))
    study = min(r2 for r2, _ in results["study's"]["chosen"].values())
    bars = [
        Bar("R² of the study's helical module, lowest axis", study, 0.9999, "", False),
        Bar("R² of all helical designs, lowest axis", totals["grid"]["chosen"]["lowest"], 0.9999, "", False),
        Bar("R² of helical designs between them", totals["test"]["chosen"]["lowest"], 0.9999, "", False),
        *(Bar("R² of a tendon joint", r2, 0.9999, "", False) for r2, _ in tendons),
        Bar("share of check states in the 90 % band", totals["test"]["covered"], 0.85, "", False),
        Bar("evaluations, slowest law", totals["grid"]["slowest_million_per_s"], 1.0, "million/s", False),
    ]
    write(
        "surrogate_three_axes", {"designs": results, "test": tests, "totals": totals, "tendon": tendons}, bars
    )


def _left_out_y(one: Mapping[str, Any]) -> list[float]:
    """Return RMS errors over the range of y's left-out states, by the law that was chosen."""
    own = one["left_out"]["left_out_together" if one["form"] == "energy" else "left_out_apart"]
    return [own["y"]]


if __name__ == "__main__":
    main()
