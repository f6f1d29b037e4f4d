"""Errors of the joint law on FEM states left out: adaptive degree, the published form, with and without slopes.

python -m benchmarks.law_error        prints, and writes benchmarks/out/law_error.json
"""

from __future__ import annotations

import dataclasses

import numpy as np
from benchmarks.output import ROOT, registry, workbench, write

from pliant.config.loading import load_study
from pliant.errors import UserError
from pliant.pipeline.study import solve_study_fem
from pliant.records.fem import FemDataset
from pliant_plugins.surrogates.config import PolynomialConfig
from pliant_plugins.surrogates.polynomial.surrogate import Polynomial


def main() -> None:
    study = load_study(ROOT / "examples" / "first_finger" / "finger.yaml", registry(), ["fem.sampling=grid"])
    data: FemDataset = solve_study_fem(workbench(), study)[0].value.axis("y")
    results = {"n_fitted": len(data.select("fit")), "n_heldout": len(data.select("check"))}
    print(f"{results['n_fitted']} states fitted, {results['n_heldout']} left out; worst error / range, R²")
    fits = {
        "adaptive": (PolynomialConfig(), data),
        "adaptive, values only": (PolynomialConfig(), without_slopes(data)),
        "published form": (PolynomialConfig(form="study"), data),
    }
    for name, (config, states) in fits.items():
        report = Polynomial(config).fit(states).report
        results[name] = {"worst_of_range": report.worst_of_range, "r2": report.r2}
        print(f"{name:<24} {100 * report.worst_of_range:10.2g} %   {report.r2:.8f}")
    for count in (6, 8, 10, 14, 20):
        worst = {}
        for name, source in (("with slopes", data), ("without", without_slopes(data))):
            worst[name] = spread_fit_error(source, count)
        results[f"{count} states"] = worst
        shown = {name: "-" if error is None else f"{100 * error:.2g} %" for name, error in worst.items()}
        cells = ", ".join(f"{name} {text}" for name, text in shown.items())
        print(f"{count:>2} states: {cells}")
    write("law_error", results)


def without_slopes(data: FemDataset) -> FemDataset:
    """Return the states without slopes."""
    unknown = np.full(len(data), np.nan)
    return dataclasses.replace(data, dmoment_dp=unknown, dmoment_du=unknown)


def spread_fit_error(data: FemDataset, count: int) -> float | None:
    """Return the worst error of the range with `count` well-spread fit states; None if they are too few."""
    fit = np.flatnonzero(data.role == "fit")
    points = np.stack(
        [data.actuation / np.ptp(data.actuation), data.angle_rad / np.ptp(data.angle_rad)], axis=1
    )
    chosen = [int(fit[0])]
    while len(chosen) < count:  # farthest point next
        distance = np.linalg.norm(points[fit][:, None] - points[chosen], axis=2).min(axis=1)
        chosen.append(int(fit[np.argmax(distance)]))
    keep = np.isin(np.arange(len(data)), chosen) | (data.role == "check")
    subset = data.rows(keep)
    try:
        return Polynomial(PolynomialConfig()).fit(subset).report.worst_of_range
    except UserError:  # too few states for any polynomial: a gap in this table
        return None


if __name__ == "__main__":
    main()
