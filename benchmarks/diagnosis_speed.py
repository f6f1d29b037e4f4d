"""How long a diagnosis takes: one joint and a chain of eight, in CPU seconds and beside a loop timed in the same run.

    python -m benchmarks.diagnosis_speed [--kinds stiffness,viscoelastic] [--seed 3]

CPU seconds depend on the machine and on what else runs; their ratio to a reference, products of small matrices in
numpy, less so. Code is compiled before anything is timed.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
from benchmarks.evidence.sets import SetSpec, make_set
from benchmarks.output import parser_of, seconds_of

from pliant import api

# Robot, and the effect that is hidden in it.
CASES = (("joint", "stiffness"), ("chain", "viscoelastic"))
REFERENCE_PRODUCTS = 100_000


def reference_cpu_s() -> float:
    """CPU seconds of products of 8 × 8 matrices one after another."""
    matrix = np.random.default_rng(0).normal(size=(8, 8)) / 8.0

    def products() -> None:
        product = np.eye(8)
        for _ in range(REFERENCE_PRODUCTS):
            product = matrix @ product

    return seconds_of(products)[0]


def diagnosis_cpu_s(robot: str, kind: str, seed: int, kinds: list[str] | None) -> tuple[float, str]:
    """CPU seconds of one diagnosis, and its verdict."""
    measured = make_set(SetSpec(kind, seed, "functional", robot))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "study.yaml").write_text(measured.study)
        (folder / "data.csv").write_text(measured.csv)
        opened = api.open_study(str(folder / "study.yaml"))
        predictor = api.predictor(opened, str(folder / "data.csv"))
        predictor.evaluate(())
        found: list[str] = []
        (spent,) = seconds_of(lambda: found.append(api.diagnose_with(predictor, kinds=kinds).verdict))
    return spent, found[0]


def main() -> None:
    """Print the table."""
    parser = parser_of(__doc__)
    parser.add_argument("--kinds", help="candidates, separated by commas; all by default")
    parser.add_argument("--seed", type=int, default=3)
    given = parser.parse_args()
    kinds = given.kinds.split(",") if given.kinds else None
    # The first diagnosis compiles the terms of every effect.
    diagnosis_cpu_s("joint", "stiffness", given.seed, kinds)
    print(f"{'robot':8}{'hidden':16}{'CPU s':>8}{'reference s':>14}{'ratio':>8}  verdict")
    for robot, kind in CASES:
        reference = reference_cpu_s()
        spent, verdict = diagnosis_cpu_s(robot, kind, given.seed, kinds)
        print(f"{robot:8}{kind:16}{spent:8.2f}{reference:14.3f}{spent / reference:8.1f}  {verdict}")


if __name__ == "__main__":
    main()
