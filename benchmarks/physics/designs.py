"""Random designs solved to a stable equilibrium from a cold start, and the failures explained.

    python -m benchmarks.physics.designs      prints, and writes benchmarks/out/physics_designs.json

An answer counts when the common statics in Python, not the engine, find its residual below 1e-9 N·m and its
stiffness positive definite.
"""

from __future__ import annotations

import statistics
import time
from collections import Counter

import numpy as np
from benchmarks.output import Bar, engine, time_calls, write
from benchmarks.physics.helix import random_cases

from pliant.interfaces.physics import Case
from pliant.mechanics.statics import ChainStatics, Loads, unstable_mode
from pliant.records.rollout import Equilibrium

DESIGNS = 1000
# The engine's residual and the statics' differ by rounding.
TOLERANCE_N_M = 1.01e-9
SOLVED = "stable equilibrium"


def main() -> None:
    cases, backend, ends = random_cases(DESIGNS), engine("quasistatic"), list[Equilibrium]()
    backend.settle_batch(cases[:2])  # compiles
    (wall_s,) = time_calls(lambda: ends.extend(backend.settle_batch(cases)), clock=time.perf_counter)
    verdicts = [verdict(case, end) for case, end in zip(cases, ends, strict=True)]
    counts = Counter(verdicts)
    joints = statistics.mean(case.chain.n_joints for case in cases)
    rate = DESIGNS / wall_s
    print(f"{DESIGNS} designs of {joints:.0f} joints on average in {wall_s:.2f} s: {rate:.0f} designs/s")
    for text, count in counts.most_common():
        print(f"  {count:5d} {text}")
    for number in [k for k, text in enumerate(verdicts) if text != SOLVED][:10]:
        chain, residual = cases[number].chain, ends[number].residual
        print(f"  design {number}: {verdicts[number]}; {chain.n_joints} joints, residual {residual:.1e}")
    iterations = [end.iterations for end in ends]
    median = statistics.median(iterations)
    print(f"  iterations: median {median:.0f}, most {max(iterations)}")
    bar = Bar("random designs in a stable equilibrium", counts[SOLVED], DESIGNS, "of 1000", at_most=False)
    write("physics_designs", {"verdicts": counts, "wall_s": wall_s, "median_iterations": median}, [bar])


def verdict(case: Case, end: Equilibrium) -> str:
    """Return the verdict of the common statics on an equilibrium."""
    balance = ChainStatics(case.chain).balance(end.joint_angles, Loads.from_inputs(case.chain, case.inputs))
    balanced = np.abs(balance.residual).max() <= TOLERANCE_N_M
    if balanced and unstable_mode(balance.stiffness) is None:
        return SOLVED if end.converged else f"{SOLVED} that the engine did not trust"
    honest = "said so" if not end.converged else "NOT SAID"
    runs_away = any(entry.variable == "dtau_du" for entry in end.outside_domain)
    cause = "a law that runs away" if runs_away else "no balance" if not balanced else "a saddle"
    return f"{cause} ({honest})"


if __name__ == "__main__":
    main()
