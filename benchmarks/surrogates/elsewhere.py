"""Published COMSOL tables as laws, scored on left-out states and on left-out levels.

    python -m benchmarks.surrogates.elsewhere

Reads ../shared/data/reference (skips where it is absent). Half-module angles are doubled. Held out are (i) a seeded
fifth of the rows and (ii) whole inner levels of pressure or force: each level with a constrained branch separately, the
levels with a free point only in three interleaved groups. Errors are of the moment, as shares of its range over the
rows used.

The tendon joint ends at stops: past u = −0.02 rad the moment rises five times as steeply, and the last free point
(7.925 N) is beyond a second one (`benchmarks.families.tendon_joint`). Four of its free points deviate by 4 to 10 mrad,
up to 1.3 % of the range, from the limit of their constrained branch. Therefore it is scored on all rows, on the rows
between the stops, and on the constrained rows between the stops.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from benchmarks.output import REFERENCE, Bar, component, reference_table, write
from numpy.typing import NDArray

from pliant.errors import MissingDependencyError
from pliant.interfaces.surrogate import Surrogate
from pliant.records.design import Design
from pliant.records.fem import FemDataset

HELICAL, TENDON = "helical_y_fem_R5.66_l4.72.csv", "tendon_joint_fem.csv"
KINDS = ("polynomial", "neural", "table")
STOP_RAD, FREE_TOP_N = -0.02, 7.5
GROUPS, SEED, LEVEL = 3, 0, 0.9
WORST = 1.0  # % of the range
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Score:
    """Errors of left-out states, in % of the moment's range, and their share in the 90 % band."""

    worst: float
    rms: float
    covered: float | None
    n: int
    stable: bool
    wall_s: float


def published(name: str) -> FemDataset:
    """Return a reference table as data of one axis."""
    rows = reference_table(name)
    actuation = "pressure_pa" if "pressure_pa" in rows else "tendon_force_n"
    angle = 2 * rows["half_angle_rad"] if "half_angle_rad" in rows else rows["joint_angle_rad"]
    moment = rows["moment_n_m"]
    n = len(moment)
    missing = np.full(n, np.nan)
    branch, status, role = np.where(moment == 0, "free", "constrained"), np.full(n, "ok"), np.full(n, "fit")
    states = (rows[actuation], angle, moment, missing, missing, missing, branch, status, role)
    return FemDataset(Design("table", {}), "y", actuation, *states)


def fifth(data: FemDataset) -> Iterator[Mask]:
    """Yield a mask of a fifth of the states, drawn with a seed."""
    chosen = np.zeros(len(data), bool)
    chosen[np.random.default_rng(SEED).permutation(len(data))[: len(data) // 5]] = True
    yield chosen


def levels(data: FemDataset) -> Iterator[Mask]:
    """Yield masks of inner levels with a constrained branch, and of groups of levels with a free point only."""
    values, counts = np.unique(data.actuation, return_counts=True)
    inner, many = values[1:-1], counts[1:-1] > 1
    for value in inner[many]:
        yield data.actuation == value
    single = inner[~many]
    for k in range(min(GROUPS, len(single))):
        yield np.isin(data.actuation, single[k::GROUPS])


def score(surrogate: Surrogate, data: FemDataset, left_out: Iterator[Mask]) -> Score:
    """Fit without each set of states and judge the law there."""
    misses, inside, stable, started = [], [], True, time.perf_counter()
    for mask in left_out:
        law = surrogate.fit(replace(data, role=np.where(mask, "check", "fit"))).law
        check = data.rows(mask)
        u = check.angle_rad[:, None]
        missed = law.evaluate(check.actuation, u).tau[:, 0] - check.moment_n_m
        misses.append(missed)
        half = law.band(check.actuation, u, LEVEL)
        if half is not None:
            inside.append(np.abs(missed) <= half[:, 0])
        ends = (law.domain.actuation, law.domain.deformation[0])
        p, v = np.meshgrid(*(np.linspace(*one, 61) for one in ends))
        stable &= bool(law.evaluate(p.ravel(), v.reshape(-1, 1)).dtau_du.max() < 0)
    all_misses = 100 * np.concatenate(misses) / np.ptp(data.moment_n_m)
    return Score(
        float(np.abs(all_misses).max()),
        float(np.sqrt(np.mean(all_misses**2))),
        float(np.mean(np.concatenate(inside))) if inside else None,
        len(all_misses),
        stable,
        time.perf_counter() - started,
    )


def cases() -> dict[str, FemDataset]:
    """Return the tables and their parts."""
    tendon = published(TENDON)
    between = (tendon.angle_rad > STOP_RAD) & (tendon.actuation <= FREE_TOP_N)
    return {
        "helical_y": published(HELICAL),
        "tendon, all rows": tendon,
        "tendon between the stops": tendon.rows(between),
        "tendon between the stops, constrained rows": tendon.rows(between & (tendon.moment_n_m > 0)),
    }


def main() -> None:
    if not (REFERENCE / HELICAL).is_file():
        print(f"{REFERENCE} is absent: nothing to do")
        return
    results: dict[str, Any] = {}
    bars = []
    print(
        f"{'data':<44}{'left out':<8}{'kind':<12}{'worst':>9}{'rms':>9}{'in band':>9}{'stable':>8}{'time':>9}"
    )
    for name, data in cases().items():
        for label, way in (("fifth", fifth), ("levels", levels)):
            found: dict[str, Score] = {}
            for kind in KINDS:
                try:
                    found[kind] = score(component("surrogate", kind), data, way(data))
                except MissingDependencyError as error:
                    print(f"{name:<44}{label:<8}{kind:<12}{error}")
                    continue
                s = found[kind]
                covered = "—" if s.covered is None else f"{100 * s.covered:.0f} %"
                print(
                    f"{name:<44}{label:<8}{kind:<12}{s.worst:>7.3f} %{s.rms:>7.4f} %{covered:>9}"
                    f"{'yes' if s.stable else 'NO':>8}{s.wall_s:>7.1f} s",
                    flush=True,
                )
            scores = {kind: vars(s) for kind, s in found.items()}
            results.setdefault(name, {})[label] = {"n_rows": len(data), **scores}
            best = min(found, key=lambda kind: found[kind].worst)
            what = f"{name}, {label} left out, worst of the range ({best})"
            bars.append(Bar(what, found[best].worst, WORST, "%", at_most=True))
    write("surrogates_elsewhere", results, bars)


if __name__ == "__main__":
    sys.exit(main())
