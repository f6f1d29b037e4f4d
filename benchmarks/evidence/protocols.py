"""Protocols of the bench as data: runs of drive, load, temperature and orientation over time.

| protocol | runs | samples | minutes of motion | what it can tell |
|---|---|---|---|---|
| `rich` | 30 | 4250 | 24 | two specimens, each all of the runs below |
| `rich_noload` | 26 | 3698 | 20 | the same without the load steps |
| `rates` | 9 | 1118 | 7 | one specimen, three rates, no load |
| `poor` | 5 | 750 | 5 | one specimen, one rate |
| `midway` | 30 | 3738 | 22 | as `rich`, but every recording begins in mid-transient, and some lack a stretch |
| `rich_open` | 28 | 4010 | 23 | as `rich` without the closed valve: every recording begins at rest, or nearly so |
| `payload` | 26 | 2852 | 19 | without and with payloads of two sizes, hanging and horizontal, filled and half filled |
| `coarse` | 12 | 848 | 6 | steps and cycles as quick as 0.2 s of lag, sampled at 2.5 Hz |
| `example` | 16 | 2354 | 16 | two specimens: virgin, slow, fast, holds, load, load steps, repeat |

`rich` has, of each specimen: virgin, slow, fast, holds, ± load, horizontal, sideways, hot, load steps without pressure
and with it, closed valve, steps at 50 Hz, second sensor, and a repeat. Chains leave out the steps at 50 Hz:
they swing too slowly to come to rest between samples, in every dynamic truth. Tendons have no valve to close.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from benchmarks.evidence.robots import JOINT, PEAK_TORQUE_N_M, PRESSURE_MAX_PA, Array, Robot
from numpy.typing import NDArray

SAMPLE_S, DENSE_S = 0.4, 0.02
DENSE = "steps at 50 Hz"
ROOM_C, HOT_C = 22.0, 52.0
LOAD_N_M = 0.15 * PEAK_TORQUE_N_M
LOAD_LEVELS = (0.0, 1.0, 0.0, -1.0, 0.6, 0.0)
# Of a recording that begins in mid-transient: the share of the first rise before it, and the samples of a lost stretch.
BEGUN, LOST = 0.4, 15
Angles = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Run:
    """One run: everything (t,) but its names and its conditions.

    Attributes:
        pressure_pa: commanded, in a robot with a tendon the share of its largest force times the largest pressure.
        time_s: from the start of the run, increasing.
        base_angles_rad: the base's turns about world x, y, z in that order.
        valve_open: 1 where the chambers are connected to the supply; None where they always are.
        second: the second sensor is read.
        kept: (t,) of the samples that are recorded; None where all are.
        payload_kg: hung at the tip.
    """

    condition: str
    specimen: str
    pressure_pa: Array
    moment_n_m: Array
    temperature_c: float = ROOM_C
    base_angles_rad: Angles = (0.0, 0.0, 0.0)
    valve_open: Array | None = None
    second: bool = False
    time_s: Array = field(default_factory=lambda: np.empty(0))
    kept: NDArray[np.bool_] | None = None
    payload_kg: float = 0.0

    def __post_init__(self) -> None:
        if not len(self.time_s):
            object.__setattr__(self, "time_s", np.arange(len(self.pressure_pa), dtype=float) * SAMPLE_S)

    @property
    def valve(self) -> Array:
        """(t,) 1 open, 0 closed."""
        return np.ones(len(self)) if self.valve_open is None else self.valve_open

    def recorded(self) -> Run:
        """Return the run in its recorded form, whose clock starts with it."""
        if self.kept is None:
            return self
        cut = {name: getattr(self, name)[self.kept] for name in ("pressure_pa", "moment_n_m", "time_s")}
        cut["time_s"] = cut["time_s"] - cut["time_s"][0]
        valve = None if self.valve_open is None else self.valve_open[self.kept]
        return replace(self, **cut, valve_open=valve, kept=None)

    @property
    def seconds(self) -> float:
        return float(self.time_s[-1])

    def __len__(self) -> int:
        return len(self.pressure_pa)


Protocol = tuple[Run, ...]


def triangles(period_s: float, amplitudes: list[float]) -> Array:
    """Return pressure cycles from zero, shares of the largest."""
    n = round(period_s / SAMPLE_S)
    shape = 1 - np.abs(2 * np.arange(n) / n - 1)
    return PRESSURE_MAX_PA * np.concatenate([a * shape for a in amplitudes])


def steps(levels: tuple[float, ...], hold_s: float, rise_s: float = 1.2, sample_s: float = SAMPLE_S) -> Array:
    """Return levels reached along straight lines of `rise_s`, then held."""
    n, rising = round(hold_s / sample_s), round(rise_s / sample_s)
    ramp = np.minimum(1.0, np.arange(1, n + 1) / rising)
    before = (0.0, *levels[:-1])
    return np.concatenate([a + (b - a) * ramp for a, b in zip(before, levels, strict=True)])


def _free(condition: str, specimen: str, pressure: Array, **conditions: float | Angles | bool) -> Run:
    return Run(condition, specimen, pressure, np.zeros(len(pressure)), **conditions)


def _loaded(condition: str, specimen: str, pressure: Array, share: float) -> Run:
    return Run(condition, specimen, pressure, np.full(len(pressure), share * LOAD_N_M))


def _load_steps(specimen: str) -> list[Run]:
    """Return steps of the load, first without pressure, then at constant pressure."""
    load = LOAD_N_M * steps(LOAD_LEVELS, 9.2)
    held = 0.6 * PRESSURE_MAX_PA * np.minimum(1.0, np.arange(len(load)) / 3)
    pressures = {"passive load steps": np.zeros(len(load)), "load steps": held}
    return [Run(name, specimen, pressure, load) for name, pressure in pressures.items()]


def _closed_valve(specimen: str) -> Run:
    """Fill, close the valve for 20 s, open it and vent: at the top, then half way up."""
    once = steps((1.0, 1.0, 0.0), 8.0), np.repeat([1.0, 0.0, 1.0], 20)
    pressure = PRESSURE_MAX_PA * np.concatenate([once[0], 0.5 * once[0]])
    # Closed from the end of the first hold; the command is constant meanwhile.
    return Run("closed valve", specimen, pressure, np.zeros(len(pressure)), valve_open=np.tile(once[1], 2))


def _step_response(specimen: str) -> Run:
    """Return steps of pressure, up and down, of two sizes, then three of load, sampled densely at first.

    Each follows a cycloid of 0.37 s: it makes a heavy joint swing at 1 to 4 Hz and leaves the bare one's own 8 Hz
    alone. A supply is late in the steps of pressure only, a sensor in all.
    """
    hold_s, rise_s, dense_s = 2.6, 0.37, 1.0
    dense = np.arange(DENSE_S, dense_s, DENSE_S)
    local = np.concatenate([dense, np.arange(dense_s, hold_s + 1e-9, SAMPLE_S)])
    share = np.minimum(1.0, local / rise_s)
    up, rest = share - np.sin(2 * np.pi * share) / (2 * np.pi), np.ones(len(local))
    none = 0 * rest
    pressure = [0.8 * up, 0.8 * (1 - up), 0.5 * up, 0.5 * (1 - up), none, none, none]
    load = [none, none, none, none, up, 1 - 2 * up, up - 1]
    clock = np.concatenate([k * hold_s + local for k in range(len(load))])
    inputs = (PRESSURE_MAX_PA * np.concatenate(pressure), LOAD_N_M * np.concatenate(load))
    return Run(DENSE, specimen, *inputs, time_s=clock)


def _medium(specimen: str, cycles: int = 2) -> Run:
    return _free("medium", specimen, triangles(20, [1.0] * cycles))


def _unloaded(specimen: str) -> list[Run]:
    holds = PRESSURE_MAX_PA * steps((0.3, 0.7, 1.0, 0.5, 0.0), 18.0)
    return [
        _free("virgin", specimen, triangles(12.8, [0.35, 0.35, 0.7, 0.7, 1.0, 1.0])),
        _free("slow", specimen, triangles(80, [1.0])),
        _free("fast", specimen, triangles(4.8, [1.0] * 7)),
        _free("holds", specimen, holds),
    ]


def _rich(specimen: str, load_steps: bool = True) -> list[Run]:
    cycles = triangles(20, [1.0, 1.0])
    return [
        *_unloaded(specimen),
        _loaded("load +", specimen, cycles, 1.0),
        _loaded("load -", specimen, 0.6 * cycles, -1.0),
        _free("horizontal", specimen, triangles(20, [1.0] * 3), base_angles_rad=(0.0, np.pi / 2, 0.0)),
        _free("sideways", specimen, triangles(20, [1.0]), base_angles_rad=(np.pi / 2, 0.0, 0.0)),
        _free("hot", specimen, triangles(20, [1.0] * 2), temperature_c=HOT_C),
        *(_load_steps(specimen) if load_steps else []),
        _closed_valve(specimen),
        _step_response(specimen),
        _free("second sensor", specimen, triangles(20, [1.0]), second=True),
        _medium(specimen),
    ]


def _payload(specimen: str) -> list[Run]:
    """Return runs with payloads in shares of the robot's largest one."""
    virgin, slow, fast, _ = _unloaded(specimen)
    lying = {"hanging": (0.0, 0.0, 0.0), "horizontal": (0.0, np.pi / 2, 0.0)}
    hung = [
        _free(f"payload, {name}", specimen, triangles(20, [top] * 2), payload_kg=kg, base_angles_rad=turned)
        for name, turned in lying.items()
        for kg in (0.5, 1.0)
        for top in (1.0, 0.5)
    ]
    second = _free("second sensor", specimen, triangles(20, [1.0]), second=True)
    return [virgin, slow, fast, *hung, second, _medium(specimen)]


def _rates(specimen: str) -> list[Run]:
    _, slow, fast, _ = _unloaded(specimen)
    return [_medium(specimen, 3), *[slow, fast, _medium(specimen), _medium(specimen)] * 2]


def _example(specimen: str) -> list[Run]:
    loaded = _loaded("load +", specimen, triangles(20, [1.0, 1.0]), 1.0)
    return [*_unloaded(specimen), loaded, *_load_steps(specimen), _medium(specimen)]


def _begun(run: Run) -> Run:
    """Return the motion recorded from within its first rise on; long runs also lack an interval."""
    course = np.abs(run.pressure_pa - run.pressure_pa[0]) / PRESSURE_MAX_PA
    course += np.abs(run.moment_n_m - run.moment_n_m[0]) / LOAD_N_M
    rising = np.diff(course) > 0
    start = int(np.argmax(rising))
    kept = np.ones(len(run), dtype=bool)
    kept[: start + max(1, round(BEGUN * np.argmin(rising[start:])))] = False
    if run.seconds > 40.0:
        lost = round(0.45 * len(run))
        kept[lost : lost + LOST] = False
    return replace(run, kept=kept)


def _coarse(specimen: str) -> list[Run]:
    """Return steps of 0.8 s and cycles of 4.8 and 3.2 s, at 2.5 Hz."""
    quick = PRESSURE_MAX_PA * steps((0.6, 0.0, 1.0, 0.4, 0.8, 0.0), 4.0, rise_s=0.8)
    load = LOAD_N_M * steps((1.0, -1.0, 0.5, 0.0), 4.0, rise_s=0.8)
    return [
        _free("quick steps", specimen, quick),
        Run("quick load steps", specimen, np.full(len(load), 0.0), load),
        _free("fast", specimen, triangles(4.8, [1.0] * 7)),
        _free("faster", specimen, triangles(3.2, [0.8] * 10)),
        _medium(specimen),
        _free("quick steps", specimen, quick),
    ]


# The runs of each protocol, specimen by specimen.
PROTOCOLS: dict[str, Callable[[], list[Run]]] = {
    "rich": lambda: [*_rich("A"), *_rich("B")],
    "rich_noload": lambda: [*_rich("A", False), *_rich("B", False)],
    "rich_open": lambda: [run for run in (*_rich("A"), *_rich("B")) if run.valve_open is None],
    "rates": lambda: _rates("A"),
    "poor": lambda: [_medium("A", 3) for _ in range(5)],
    "midway": lambda: [_begun(run) for run in (*_rich("A"), *_rich("B"))],
    "payload": lambda: [*_payload("A"), *_payload("B")],
    "coarse": lambda: [*_coarse("A"), *_coarse("B")],
    "example": lambda: [*_example("A"), *_example("B")],
}
NAMES = tuple(PROTOCOLS)


def protocol(name: str, robot: Robot = JOINT) -> Protocol:
    """Return the runs of a protocol that this robot can perform, in their order."""
    if name not in PROTOCOLS:
        raise ValueError(f"no protocol '{name}': {', '.join(NAMES)}")

    def possible(run: Run) -> bool:
        if run.condition == DENSE:
            return robot.modules == 1
        return run.valve_open is None or not robot.tendon

    every = tuple(run for run in PROTOCOLS[name]() if possible(run))
    if name != "payload":
        return every
    return tuple(replace(run, payload_kg=run.payload_kg * robot.payload_max_kg) for run in every)
