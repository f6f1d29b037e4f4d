"""What the bench does, as data: runs of pressure, load, temperature and orientation over time.

| protocol | runs | samples | minutes of motion | what it can tell |
|---|---|---|---|---|
| `rich` | 20 | 3254 | 22 | two specimens, each virgin, slow, fast, holds, ± load, horizontal, hot, load steps, repeat |
| `rich_noload` | 18 | 2702 | 18 | the same without the load steps |
| `rates` | 9 | 1118 | 7 | one specimen, three rates, no load |
| `poor` | 5 | 750 | 5 | one specimen, one rate |
| `example` | 14 | 2354 | 16 | two specimens: virgin, slow, fast, holds, load, load steps, repeat |
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from benchmarks.evidence.robots import PEAK_TORQUE_N_M, PRESSURE_MAX_PA, Array

SAMPLE_S = 0.4
ROOM_C, HOT_C = 22.0, 52.0
LOAD_N_M = 0.15 * PEAK_TORQUE_N_M
LOAD_LEVELS = (0.0, 1.0, 0.0, -1.0, 0.6, 0.0)


@dataclass(frozen=True, eq=False)
class Run:
    """One run, sampled every `SAMPLE_S`: everything (t,) but its names and its orientation."""

    condition: str
    specimen: str
    pressure_pa: Array
    moment_n_m: Array
    temperature_c: float = ROOM_C
    base_pitch_rad: float = 0.0

    @property
    def time_s(self) -> Array:
        """(t,) from the start of the run."""
        return np.arange(len(self.pressure_pa), dtype=float) * SAMPLE_S

    def __len__(self) -> int:
        return len(self.pressure_pa)


Protocol = tuple[Run, ...]


def triangles(period_s: float, amplitudes: list[float]) -> Array:
    """Pressure cycles from zero, shares of the largest."""
    n = round(period_s / SAMPLE_S)
    shape = 1 - np.abs(2 * np.arange(n) / n - 1)
    return PRESSURE_MAX_PA * np.concatenate([a * shape for a in amplitudes])


def steps(levels: tuple[float, ...], hold_s: float, rise_s: float = 1.2) -> Array:
    """Levels reached along straight lines of `rise_s`, then held."""
    n, rising = round(hold_s / SAMPLE_S), round(rise_s / SAMPLE_S)
    ramp = np.minimum(1.0, np.arange(1, n + 1) / rising)
    before = (0.0, *levels[:-1])
    return np.concatenate([a + (b - a) * ramp for a, b in zip(before, levels, strict=True)])


def _free(condition: str, specimen: str, pressure: Array, **conditions: float) -> Run:
    return Run(condition, specimen, pressure, np.zeros(len(pressure)), **conditions)


def _loaded(condition: str, specimen: str, pressure: Array, share: float) -> Run:
    return Run(condition, specimen, pressure, np.full(len(pressure), share * LOAD_N_M))


def _load_steps(specimen: str) -> Run:
    """The load walks through its levels, first without pressure, then at constant pressure."""
    load = LOAD_N_M * np.tile(steps(LOAD_LEVELS, 9.2), 2)
    pressure = PRESSURE_MAX_PA * np.minimum(1.0, np.maximum(0.0, np.arange(len(load)) - len(load) // 2) / 3)
    return Run("load steps", specimen, 0.6 * pressure, load)


def _medium(specimen: str, cycles: int = 2) -> Run:
    return _free("medium", specimen, triangles(20, [1.0] * cycles))


def _virgin(specimen: str) -> Run:
    return _free("virgin", specimen, triangles(12.8, [0.35, 0.35, 0.7, 0.7, 1.0, 1.0]))


def _slow(specimen: str) -> Run:
    return _free("slow", specimen, triangles(80, [1.0]))


def _fast(specimen: str) -> Run:
    return _free("fast", specimen, triangles(4.8, [1.0] * 7))


def _holds(specimen: str) -> Run:
    return _free("holds", specimen, PRESSURE_MAX_PA * steps((0.3, 0.7, 1.0, 0.5, 0.0), 18.0))


def _rich(specimen: str, load_steps: bool) -> list[Run]:
    cycles = triangles(20, [1.0, 1.0])
    return [
        _virgin(specimen),
        _slow(specimen),
        _fast(specimen),
        _holds(specimen),
        _loaded("load +", specimen, cycles, 1.0),
        _loaded("load -", specimen, 0.6 * cycles, -1.0),
        _free("horizontal", specimen, triangles(20, [1.0] * 3), base_pitch_rad=np.pi / 2),
        _free("hot", specimen, triangles(20, [1.0] * 4), temperature_c=HOT_C),
        *([_load_steps(specimen)] if load_steps else []),
        _medium(specimen),
    ]


def _rates(specimen: str) -> list[Run]:
    one_round = [_slow(specimen), _fast(specimen), _medium(specimen), _medium(specimen)]
    return [_medium(specimen, 3), *one_round, *one_round]


def _example(specimen: str) -> list[Run]:
    loaded = _loaded("load +", specimen, triangles(20, [1.0, 1.0]), 1.0)
    kinds = [_virgin, _slow, _fast, _holds]
    return [*(make(specimen) for make in kinds), loaded, _load_steps(specimen), _medium(specimen)]


def protocol(name: str) -> Protocol:
    """The runs of a protocol in the order in which they are done."""
    if name == "rich":
        return (*_rich("A", True), *_rich("B", True))
    if name == "rich_noload":
        return (*_rich("A", False), *_rich("B", False))
    if name == "rates":
        return tuple(_rates("A"))
    if name == "poor":
        return tuple(_medium("A", 3) for _ in range(5))
    if name == "example":
        return (*_example("A"), *_example("B"))
    raise ValueError(f"no protocol '{name}': {', '.join(NAMES)}")


NAMES = ("rich", "rich_noload", "rates", "poor", "example")
