"""States and time that a module's data set needs, adaptive against the grid: python -m benchmarks.families.sampling

(a) the reference bending bellow: states, solver time and worst error of the polynomial law on held-out states
    (the other strategy's check states included, so that both are judged on the same ones)
(b) the same law with and without slopes from the adaptive states
(c) a helical bellow on three axes: states and time on each piece (--helical)

Processor times are also given in units of a reference kernel of the same run, the LU of a fixed
sparse matrix. Prints the figures and writes them to benchmarks/out/sampling.json.
"""

from __future__ import annotations

import dataclasses
import json
import os
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from benchmarks.law_error import without_slopes
from benchmarks.output import make_parser, time_calls, write
from scipy.sparse.linalg import splu

from pliant.execution.progress import Silent
from pliant.pipeline.dataset import as_data, module_problems
from pliant.pipeline.sampling.plan import sample
from pliant.pipeline.sampling.walk import Subproblem
from pliant.records.fem import COLUMNS, FemDataset, ModuleData
from pliant.registry.discovery import Registry, discover
from pliant_plugins.families.reference import FINGER, HELIX_MODULE
from pliant_plugins.surrogates.config import PolynomialConfig
from pliant_plugins.surrogates.polynomial.surrogate import Polynomial

LIMIT_PA = 15e3
BENDING = {"kind": "bellow_bending", **FINGER}
WIDE = {**BENDING, "inner_radius": "2.75 mm", "average_radius": "7.5 mm", "module_length": "10 mm"}
HELICAL = {"kind": "bellow_helical", **HELIX_MODULE}


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("--helical", action="store_true", help="also three axes of a helical bellow")
    parser.add_argument("--design", choices=("reference", "wide"), help="only this bending bellow")
    arguments = parser.parse_args()
    registry = discover()
    kernel = kernel_s()
    results: dict[str, Any] = {"kernel_s": kernel, "threads": os.environ.get("OMP_NUM_THREADS", "all")}
    for name, family in (("reference", BENDING), ("wide", WIDE)):
        if arguments.design not in (None, name):
            continue
        runs = {kind: solved(registry, family, sampling=kind) for kind in ("adaptive", "grid")}
        results[name] = compared(runs, kernel)
    if arguments.helical:
        results["helical"] = three_axes(*solved(registry, HELICAL), kernel)
    print(json.dumps(results, indent=1))
    write("sampling", results)


def kernel_s() -> float:
    """Return the seconds of one sparse LU of the size of a module's stiffness, the fastest of five."""
    n = 16
    line = sp.diags([-1.0, 2.2, -1.0], [-1, 0, 1], shape=(n, n))
    one = sp.identity(n)
    matrix = sp.csc_matrix(
        sp.kron(sp.kron(line, one), one) + sp.kron(sp.kron(one, line), one) + sp.kron(one, sp.kron(one, line))
    )
    return min(time_calls(lambda: splu(matrix), 5, time.perf_counter))


def solved(registry: Registry, family: dict[str, str], **options: Any) -> tuple[ModuleData, dict[str, float]]:
    """Return a design's data set and its wall and processor seconds."""
    built = registry.build("family", config(registry, "family", family))
    material = {"kind": "neo_hookean", "shear_modulus": "240 kPa"}
    fem = config(registry, "fem", {"kind": "skfem", "pressure_max": LIMIT_PA, **options})
    backend = registry.build("fem", fem)
    substance = registry.build("material", config(registry, "material", material))
    begun, used = time.perf_counter(), time.process_time()
    problems = module_problems(built, 1)
    pieces = [Subproblem(n, backend.solver(p, substance), p.axes, p.main_axis) for n, p in problems.items()]
    with tempfile.TemporaryDirectory() as folder:
        sampling = sample(pieces, fem, LIMIT_PA, Path(folder), Silent())
    times = {"wall_s": time.perf_counter() - begun, "processor_s": time.process_time() - used}
    return as_data(built, problems, pieces, sampling), times


def config(registry: Registry, interface: str, values: dict[str, Any]) -> Any:
    """Return a plugin's config from a block in the form of a study."""
    return registry.get(interface, values["kind"]).config_model().model_validate(values)


def compared(runs: dict[str, tuple[ModuleData, dict[str, float]]], kernel: float) -> dict[str, Any]:
    """Return figures of each strategy; laws are scored on the states of both that neither fit has seen."""
    laws = {kind: data.axis(data.main_axis) for kind, (data, _) in runs.items()}
    checks = joined([law.select("check") for law in laws.values()])
    figures = {}
    for kind, (data, times) in runs.items():
        fitted = joined([laws[kind].select("fit"), checks])
        figures[kind] = {
            "states": len(data),
            "failed": len(data.failed),
            "iterations": int(data.iterations.sum()),
            **times,
            "processor_in_kernels": times["processor_s"] / kernel,
            "with_slopes": scored(fitted),
            "without_slopes": scored(without_slopes(fitted)),
            "sampling": {k: v for k, v in data.sampling["axes"][data.main_axis].items() if k != "tests"},
        }
    return figures


def joined(parts: list[FemDataset]) -> FemDataset:
    """Return states of several data sets of one axis."""
    columns = {name: np.concatenate([getattr(part, name) for part in parts]) for name in COLUMNS}
    return dataclasses.replace(parts[0], **columns)


def scored(data: FemDataset) -> dict[str, float]:
    """Return errors of the polynomial law on the check states, as shares of the effort's range."""
    report = Polynomial(PolynomialConfig()).fit(data).report
    figures = {name: getattr(report, name) for name in ("n_fitted", "n_heldout", "worst_of_range")}
    return {**figures, "rms_of_range": report.rmse / report.effort_range}


def three_axes(data: ModuleData, times: dict[str, float], kernel: float) -> dict[str, Any]:
    """Return figures of a module of several axes."""
    explored, axes = np.unique(data.explored), data.sampling["axes"]
    return {
        "states": data.sampling["n_solved"],
        "failed": len(data.failed),
        **times,
        "processor_in_kernels": times["processor_s"] / kernel,
        "solver_s_by_axis": {str(a): float(data.wall_s[data.explored == a].sum()) for a in explored},
        "axes": {a: {k: v for k, v in one.items() if k != "tests"} for a, one in axes.items()},
        "coupling": data.sampling["coupling"],
    }


if __name__ == "__main__":
    main()
