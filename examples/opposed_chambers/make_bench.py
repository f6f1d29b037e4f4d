"""Makes bench.csv: what a bench would record of a joint with two opposed chambers whose physics Pliant is not told.

python examples/opposed_chambers/make_bench.py

The truth is integrated here in small steps, and its equations are not those of any effect: the stress relaxes with
two times, chambers vent more slowly than they fill, and the elastic moment has a term that the study's law lacks.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
FILE = Path(__file__).parent / "bench.csv"
SEED = 4
STEP_S, SAMPLE_S = 0.02, 0.2
# Moment per pressure, its loss with the angle, stiffness, and what the stated law of joint.yaml does not have.
PUSH, SOFTER, STIFF, CUBIC = 1.6e-6, -1.1e-6, 0.05, 0.006
RELAXING = ((0.2, 6.0), (0.1, 20.0))  # share of the stiffness, s
FILLING_S, VENTING_S = 0.25, 0.32
NOISE_RAD, NOISE_MEMORY_S, OFFSET_RAD = 8e-3, 0.6, 2e-3
LEVEL_PA, RAMP_S = 2e4, 2.0


def main() -> None:
    """Four runs, each twice."""
    chance = np.random.default_rng(SEED)
    lines = ["run,time_s,pressure_1_pa,pressure_2_pa,moment_n_m,angle_rad"]
    for name, time, first, second, moment in runs():
        angle = joint(time, first, second, moment)
        for repeat in ("a", "b"):
            read = angle + noise(len(time), chance)
            rows = np.column_stack([time, first, second, moment, read])[:: round(SAMPLE_S / STEP_S)]
            lines += [f"{name}_{repeat},{t:g},{p:.0f},{q:.0f},{m:g},{u:.5f}" for t, p, q, m, u in rows]
    FILE.write_text("\n".join(lines) + "\n")


def runs() -> Iterator[tuple[str, Array, Array, Array, Array]]:
    """Name, and (t,) times, pressures and opposing moment."""
    yield cycles("slow", 40.0, 80.0)
    yield cycles("fast", 14.0, 56.0)
    time = np.arange(0.0, 80.0, STEP_S)
    first = LEVEL_PA * ((time > 2) & (time < 32))
    second = LEVEL_PA * ((time > 42) & (time < 62))
    yield "holds", time, ramped(first), ramped(second), np.zeros_like(time)
    time = np.arange(0.0, 96.0, STEP_S)
    moment = 6e-3 * (np.floor(time / 6).astype(int) % 4 == 1) - 6e-3 * (
        np.floor(time / 6).astype(int) % 4 == 3
    )
    both = ramped(0.5 * LEVEL_PA * (time > 48))
    yield "loads", time, both, both, moment


def cycles(name: str, period_s: float, length_s: float) -> tuple[str, Array, Array, Array, Array]:
    """Chamber 1 up and down, then chamber 2, as half waves."""
    time = np.arange(0.0, length_s, STEP_S)
    wave = LEVEL_PA * np.sin(2 * np.pi * time / period_s)
    return name, time, np.clip(wave, 0, None), np.clip(-wave, 0, None), np.zeros_like(time)


def ramped(pressure: Array) -> Array:
    """Steps that take `RAMP_S`."""
    window = np.ones(round(RAMP_S / STEP_S))
    padded = np.concatenate([np.full(len(window) - 1, pressure[0]), pressure])
    return np.convolve(padded, window / len(window), mode="valid")


def joint(time: Array, first: Array, second: Array, moment: Array) -> Array:
    """(t,) angle: both chambers' own pressures, then the balance of moments, step by step."""
    p, q = chamber(first), chamber(second)
    angle, angles = 0.0, np.zeros_like(time)
    branches = np.zeros(len(RELAXING))
    shares = np.array([share for share, _ in RELAXING])
    decay = np.exp(-STEP_S / np.array([memory for _, memory in RELAXING]))
    for k in range(len(time)):
        before, kept = angle, decay * branches
        for _ in range(4):  # Newton
            bent = angle - before
            stress = STIFF * float(shares @ (kept + bent))
            balance = (
                PUSH * (p[k] - q[k])
                + SOFTER * (p[k] + q[k]) * angle
                - 2 * STIFF * angle
                - CUBIC * angle**3
                - stress
                - moment[k]
            )
            slope = SOFTER * (p[k] + q[k]) - 2 * STIFF - 3 * CUBIC * angle**2 - STIFF * float(shares.sum())
            angle -= balance / slope
        branches = kept + (angle - before)
        angles[k] = angle
    return angles


def chamber(supply: Array) -> Array:
    """(t,) pressure behind a hose that lets air in faster than out."""
    inside, found = float(supply[0]), np.zeros_like(supply)
    for k, outside in enumerate(supply.tolist()):
        inside += STEP_S / (FILLING_S if outside > inside else VENTING_S) * (outside - inside)
        found[k] = inside
    return found


def noise(n: int, chance: np.random.Generator) -> Array:
    """(n,) of a camera: coloured, and off by a little in each run."""
    keep = float(np.exp(-STEP_S / NOISE_MEMORY_S))
    found, value = np.zeros(n), 0.0
    kicks = chance.standard_normal(n) * NOISE_RAD * np.sqrt(1 - keep**2)
    for k in range(n):
        value = keep * value + kicks[k]
        found[k] = value
    return found + OFFSET_RAD * chance.standard_normal()


if __name__ == "__main__":
    main()
