"""Exported laws: C on one core in points a second, values and slopes against ours.

python -m benchmarks.exported_laws        prints, and writes benchmarks/out/exported_laws.json
"""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from benchmarks.output import Bar, make_parser, write

from pliant.records.law import JointLaw
from pliant.testing.samples import sample_table, softening_law
from pliant_export.in_c import in_c
from pliant_export.written_law import written
from pliant_plugins.surrogates.config import NeuralConfig, PolynomialConfig, TableConfig
from pliant_plugins.surrogates.neural.surrogate import Neural
from pliant_plugins.surrogates.polynomial.surrogate import Polynomial
from pliant_plugins.surrogates.table.surrogate import TableSurrogate

POINTS, ROUNDS = 4096, 1000
SPEED = "polynomial of one axis: points a second in C"
MAIN = """
#define _POSIX_C_SOURCE 199309L
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include "law.h"
enum {{ n = {n}, rounds = {rounds} }};
static double p[n], u[n], tau[n], dp[n], du[n];
static double now(void) {{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return t.tv_sec + 1e-9 * t.tv_nsec;
}}
int main(void) {{
    for (int i = 0; i < n; ++i) if (scanf("%lf %lf", &p[i], &u[i]) != 2) return 1;
    double begun = now(), sum = 0.0;
    for (int r = 0; r < rounds; ++r) {{ p[r % n] += 1e-9; law_many(n, p, u, tau, dp, du); sum += tau[r % n]; }}
    const double many = now() - begun;
    begun = now();
    for (int r = 0; r < rounds; ++r) for (int i = 0; i < n; ++i) law(&p[i], &u[i], &tau[i], &dp[i], &du[i]);
    printf("%.9g %.9g %.3g\\n", many, now() - begun, sum);
    law_many(n, p, u, tau, dp, du);
    for (int i = 0; i < n; ++i) printf("%.17g %.17g %.17g %.17g\\n", p[i], tau[i], dp[i], du[i]);
    return 0;
}}
"""


def main() -> None:
    make_parser(__doc__).parse_args()
    states = sample_table(softening_law(), noise_n_m=1e-5)
    laws: dict[str, JointLaw] = {
        "polynomial": Polynomial(PolynomialConfig()).fit(states).law,
        "table": TableSurrogate(TableConfig()).fit(states).law,
        "neural": Neural(NeuralConfig()).fit(states).law,
    }
    results, bars = {}, []
    for name, law in laws.items():
        for where, beyond in (("inside", 0.0), ("half outside", 0.4)):
            found = measure_c(law, beyond)
            results[f"{name}, {where}"] = found
            if where == "inside" and name == "polynomial":
                bars.append(Bar(SPEED, found["per_s"], 50e6, "M/s", at_most=False, scale=1e-6))
            bars.append(Bar(f"{name}, {where}: difference of the range", found["of_range"], 1e-12, ""))
    write("exported_laws", results, bars)
    for key, found in results.items():
        print(
            f"{key:<26} {found['per_s'] / 1e6:8.1f} M/s many, {found['one_per_s'] / 1e6:8.1f} M/s one by one, "
            f"{found['steps']:.0f} steps, differs by {found['of_range']:.1e} of the range"
        )


def measure_c(law: JointLaw, beyond: float) -> dict[str, float]:
    """Return speed on one core and the largest difference of τ and its slopes, as a share of their ranges."""
    compiler = shutil.which("cc")
    if compiler is None:
        raise SystemExit("there is no C compiler 'cc' on this machine")
    form = written(law, "law")
    low, high = form.domain.T
    random = np.random.default_rng(0)
    at = low + (high - low) * random.uniform(-beyond, 1.0 + beyond, (POINTS, 2))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "law.h").write_text(in_c(form))
        (folder / "main.c").write_text(MAIN.format(n=POINTS, rounds=ROUNDS))
        subprocess.run(
            [compiler, "-std=c99", "-O3", "-march=native", "main.c", "-o", "main", "-lm"],
            cwd=folder,
            check=True,
        )
        rows = "\n".join(f"{p!r} {u!r}" for p, u in at.tolist())
        said = subprocess.run(
            [folder / "main"], input=rows, capture_output=True, text=True, check=True
        ).stdout
    first, *rest = said.splitlines()
    many_s, one_s = map(float, first.split()[:2])
    p, *theirs = np.array([row.split() for row in rest], float).T
    effort = law.evaluate(p, at[:, 1:])
    ours = [effort.tau[:, 0], effort.dtau_dp[:, 0], effort.dtau_du[:, 0, 0]]
    differs = max(np.abs(a - b).max() / np.ptp(a) for a, b in zip(ours, theirs, strict=True))
    count = POINTS * ROUNDS
    return {
        "per_s": count / many_s,
        "one_per_s": count / one_s,
        "of_range": float(differs),
        "steps": float(len(form.tape.steps)),
    }


if __name__ == "__main__":
    main()
