"""The runs of the default menu, one function each."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pliant.experiments.planned_run import (
    NEW,
    STEP_S,
    PlannedRun,
    RunMaker,
    RunShape,
    corners,
    dense_steps,
    steps,
)
from pliant.experiments.scale import BenchScale
from pliant.records.design import Array
from pliant.records.history import History

SLOW_STEP_S, FINE_STEP_S, STEP_RISE_S = 1.0, 0.02, 0.3
MEDIUM_S, SLOW_S, FAST_S = 20.0, 80.0, 4.0
TWICE = (1.0, 1.0)
RISING = (0.3, 0.3, 0.6, 0.6, 1.0, 1.0)
# A large loop with small ones inside, each turned back before its end.
LOOPS = (0.0, 1.0, 0.4, 0.8, 0.3, 0.7, 0.0, 0.6, 0.2, 0.5, 0.0)
PUSHES = (0.0, 1.0, 0.0, -1.0, 0.5, 0.0)
NUMBERS = {1: "one", 2: "two", 3: "three"}
WARMER_K = 15.0
LOADING, TURNING, MOUNTING, HEATING = 3.0, 5.0, 10.0, 15.0
MOST_ANGLES = 12


def timed_catalogue(scale: BenchScale) -> tuple[PlannedRun, ...]:
    """All runs of the default menu that make sense for this chain."""
    make = RunMaker(scale)
    return tuple(run for build in BUILDERS.values() if (run := build(make, RunShape())) is not None)


def slow_cycles(make: RunMaker, shape: RunShape) -> PlannedRun:
    """Rates, far apart from those of `fast_cycles`."""
    wave = make.cycles(shape, SLOW_S, TWICE)
    return make.run(
        "slow_cycles", f"cycle slowly, {shape.period_s or SLOW_S:g} s per cycle{_times(shape, 2)}", wave
    )


def fast_cycles(make: RunMaker, shape: RunShape) -> PlannedRun:
    """Rates: what resists motion or comes late shows."""
    wave = make.cycles(shape, FAST_S, (1.0,) * 15)
    return make.run(
        "fast_cycles", f"cycle quickly, {shape.period_s or FAST_S:g} s per cycle{_times(shape, 15)}", wave
    )


def small_loops(make: RunMaker, shape: RunShape) -> PlannedRun:
    """Reversals: what sticks turns back flat."""
    way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(LOOPS)))]) * (shape.period_s or MEDIUM_S) / 2
    wave = corners(list(zip(np.round(way * 2) / 2, LOOPS, strict=True)), STEP_S)
    return make.run(
        "small_loops", "small loops inside a large one at a medium rate: turn back before the ends", wave
    )


def holds(make: RunMaker, shape: RunShape) -> PlannedRun:
    """Holds: what relaxes goes on, and comes back after venting."""
    hold = shape.hold_s or 60.0
    wave = steps((*(shape.levels or (0.4, 0.8, 1.0)), 0.0), hold, min(SLOW_STEP_S, hold / 8))
    words = f"raise the drive in steps, hold each for {hold:g} s, release and keep recording"
    return make.run("holds", words, wave)


def virgin(make: RunMaker, shape: RunShape) -> PlannedRun:
    """A new specimen: what the first loading changes for good."""
    wave = make.cycles(shape, MEDIUM_S, RISING)
    words = "a new specimen, amplitude rising from cycle to cycle, each amplitude twice"
    needs = "a second specimen of the same make"
    return make.run("virgin", words, wave, MOUNTING, specimen=NEW, needs=needs)


def _turned(
    name: str, words: str, angles: tuple[float, float, float]
) -> Callable[[RunMaker, RunShape], PlannedRun]:
    def build(make: RunMaker, shape: RunShape) -> PlannedRun:
        wave = make.cycles(shape, MEDIUM_S, TWICE)
        needs = "a bench whose base can be turned"
        n = len(shape.amplitudes) or shape.cycles or 2
        order = f"{words}, {NUMBERS.get(n, n)} medium cycle{'s' * (n > 1)}"
        return make.run(name, order, wave, TURNING, base_angles_rad=angles, needs=needs)

    return build


def warm(make: RunMaker, shape: RunShape) -> PlannedRun:
    """Another temperature."""
    usual = make.scale.temperature_c
    there = usual + WARMER_K if shape.temperature_c is None else shape.temperature_c
    words = f"at {there:g} °C, {there - usual:g} K warmer, two medium cycles"
    wave = make.cycles(shape, MEDIUM_S, TWICE)
    return make.run(
        "warm", words, wave, HEATING, temperature_c=there, needs="a warm chamber and a thermometer"
    )


def passive_load_steps(make: RunMaker, shape: RunShape) -> PlannedRun:
    """Loads alone: the body without its drive."""
    return _loaded(make, shape, "passive_load_steps", "no pressure, load steps of both signs", 0.0)


def load_steps(make: RunMaker, shape: RunShape) -> PlannedRun:
    """Loads at a constant drive."""
    share = shape.levels[0] if shape.levels else 0.6
    return _loaded(make, shape, "load_steps", "constant pressure, load steps of both signs", share)


def _loaded(make: RunMaker, shape: RunShape, name: str, words: str, share: float) -> PlannedRun:
    hold = shape.hold_s or MEDIUM_S
    pushes = steps(PUSHES, hold, min(STEP_S, hold / 8), rise_s=min(1.0, hold / 4))
    if shape.load_n_m is not None:
        pushed: dict[str, Any] = {"moment_n_m": shape.load_n_m * pushes.share}
    else:
        pushed = dict(make.scale.loads(pushes.share))
    if not all(one.startswith("pressure") for one in make.scale.inputs):
        words = words.replace("pressure", "drive")
    drive = replace(pushes, share=np.full(len(pushes), share))
    return make.run(name, words, drive, LOADING, needs="weights or a lever", **pushed)


def blocked(make: RunMaker, shape: RunShape) -> PlannedRun | None:
    """The drive's torque by itself: the load that holds the joint at zero."""
    hold = shape.hold_s or 15.0
    levels = shape.levels or (0.25, 0.5, 0.75, 1.0)
    wave = steps((*levels, 0.0), hold, min(STEP_S, hold / 8), rise_s=hold / 3)
    moment = make.scale.blocking_moment(make.scale.actuation(wave.share))
    if moment is None:
        return None
    words = f"at {len(levels)} levels of the drive, the load that brings the angle back to zero; read the angle left"
    return make.run("blocked", words, wave, TURNING, moment_n_m=moment, needs="a lever with a load cell")


def vented_zero(make: RunMaker, shape: RunShape) -> PlannedRun:
    """The zero between cycles: what is left over, and whether it creeps back."""
    hold = shape.hold_s or 30.0
    rise = MEDIUM_S / 2
    ways = [(rise, 1.0), (rise, 0.0), (hold, 0.0), (rise, 1.0), (hold, 1.0), (rise, 0.0), (2 * hold, 0.0)]
    times = np.concatenate([[0.0], np.cumsum([span for span, _ in ways])])
    wave = corners(list(zip(times, [0.0, *(share for _, share in ways)], strict=True)), STEP_S)
    words = f"cycle, vent and read the zero for {hold:g} s; hold the top as long, vent and read the zero twice as long"
    return make.run("vented_zero", words, wave)


def closed_valve(make: RunMaker, shape: RunShape) -> PlannedRun | None:
    """What the specimen does to the air that is shut in it."""
    if not all(name.startswith("pressure") for name in make.scale.inputs):
        return None
    hold, fill, rest = shape.hold_s or 60.0, 2.0, 8.0
    points, spans, now = [(0.0, 0.0)], [], 0.0
    for level in shape.levels or (0.6, 1.0):
        closed_at = now + fill + rest  # the chamber has come to the supply's pressure before the valve closes
        points += [(now + fill, level), (closed_at + hold, level), (closed_at + hold + fill, 0.0)]
        spans.append((closed_at, closed_at + hold))
        now = closed_at + hold + fill + rest
        points.append((now, 0.0))
    wave = corners(points, min(STEP_S, hold / 8))
    closed = np.any([_between(wave.time_s, *span) for span in spans], axis=0)
    words = f"fill to {len(spans)} levels, close the valve at each and record for {hold:g} s"
    valve = np.where(closed, 0.0, 1.0)
    return make.run("closed_valve", words, wave, valve_open=valve, needs="a valve at the specimen")


def step_response(make: RunMaker, shape: RunShape) -> PlannedRun:
    """What comes late, in the first second after a step."""
    hold = shape.hold_s or 4.0
    levels, fine = (*(shape.levels or (0.6, 0.0, 1.0)), 0.0), min(1.0, hold / 2)
    wave = dense_steps(levels, hold, STEP_RISE_S, FINE_STEP_S, fine, 0.2)
    words = f"steps within {STEP_RISE_S:g} s, sampled densely (50 Hz) for {fine:g} s after each"
    return make.run("step_response", words, wave, needs="a recorder of 50 Hz")


def second_sensor(make: RunMaker, shape: RunShape) -> PlannedRun:
    """What one sensor says of another."""
    wave = make.cycles(shape, MEDIUM_S, TWICE)
    words = "two medium cycles with the tip's position and every joint's angle read too"
    adds = second_outputs(make.scale)
    return make.run("second_sensor", words, wave, MOUNTING, adds=adds, needs="a camera or a tracker")


def second_outputs(scale: BenchScale) -> tuple[str, ...]:
    """The tip's position, and the angles of the joints where there are several."""
    n = scale.chain.n_joints
    bends = scale.chain.laws[0].joint != "prismatic"
    angles = [f"joint_{k + 1}_angle_rad" for k in range(n)] if bends and 1 < n <= MOST_ANGLES else []
    return ("tip_x_m", "tip_y_m", "tip_z_m", *angles)


def _times(shape: RunShape, usual: int) -> str:
    n = len(shape.amplitudes) or shape.cycles or usual
    return {1: ", once", 2: ", twice"}.get(n, f", {n} times")


def _between(time_s: Array, low: float, high: float) -> NDArray[np.bool_]:
    inside: NDArray[np.bool_] = (time_s > low) & (time_s <= high)
    return inside


BUILDERS: Mapping[str, Callable[[RunMaker, RunShape], PlannedRun | None]] = {
    "slow_cycles": slow_cycles,
    "fast_cycles": fast_cycles,
    "small_loops": small_loops,
    "holds": holds,
    "virgin": virgin,
    "level": _turned("level", "the base horizontal", (0.0, np.pi / 2, 0.0)),
    "upside_down": _turned("upside_down", "upside down", (0.0, np.pi, 0.0)),
    "sideways": _turned(
        "sideways", "the base rolled to its side, out of the plane of bending", (np.pi / 2, 0.0, 0.0)
    ),
    "warm": warm,
    "passive_load_steps": passive_load_steps,
    "load_steps": load_steps,
    "blocked": blocked,
    "vented_zero": vented_zero,
    "closed_valve": closed_valve,
    "step_response": step_response,
    "second_sensor": second_sensor,
}


LEVELS = (0.0, 0.25, 0.5, 0.75, 1.0)
STATIC_PUSHES = (-1.0, -0.5, 0.0, 0.5, 1.0)
PUSHED_AT = 0.6
TURNED = {
    "level": ("the base horizontal", (0.0, np.pi / 2, 0.0)),
    "upside_down": ("upside down", (0.0, np.pi, 0.0)),
    "sideways": ("the base rolled to its side, out of the plane of bending", (np.pi / 2, 0.0, 0.0)),
}


def static_catalogue(scale: BenchScale) -> tuple[PlannedRun, ...]:
    """All runs of this menu that make sense for this chain."""
    levels, pushes = np.array(LEVELS), np.array(STATIC_PUSHES)
    loads = scale.loads(pushes)
    if scale.both_ways:
        levels = np.concatenate([-levels[:0:-1], levels])
    drive = "pressure" if all(name.startswith("pressure") for name in scale.inputs) else "drive"
    count = f"{len(levels)} levels of the {drive}"
    runs = [
        _run(
            scale, name, f"{words}, {count}", levels, TURNING, "a bench whose base can be turned", angles=turn
        )
        for name, (words, turn) in TURNED.items()
    ]
    there = scale.temperature_c + WARMER_K
    runs.append(
        _run(
            scale, "warm", f"at {there:g} °C, {WARMER_K:g} K warmer, {count}", levels, HEATING,
            "a warm chamber and a thermometer", temperature_c=there,
        )
    )  # fmt: skip
    for name, share, words in (
        ("passive_load_steps", 0.0, f"no {drive}"),
        ("load_steps", PUSHED_AT, f"constant {drive}"),
    ):
        order = f"{words}, {len(pushes)} loads of both signs"
        at = np.full(len(pushes), share)
        runs.append(
            _run(
                scale,
                name,
                order,
                at,
                LOADING,
                "weights or a lever",
                moment_n_m=loads["moment_n_m"],
                tip_force_n=loads["tip_force_n"],
            )
        )
    moment = scale.blocking_moment(scale.actuation(levels))
    if moment is not None:
        order = f"at {count}, the load that brings the angle back to zero; read the angle left"
        runs.append(
            _run(scale, "blocked", order, levels, TURNING, "a lever with a load cell", moment_n_m=moment)
        )
    order = f"{count} with the tip's position and every joint's angle read too"
    adds = second_outputs(scale)
    runs.append(_run(scale, "second_sensor", order, levels, MOUNTING, "a camera or a tracker", adds=adds))
    return tuple(runs)


def _run(
    scale: BenchScale,
    name: str,
    words: str,
    share: Array,
    minutes: float,
    needs: str,
    *,
    angles: tuple[float, float, float] | None = None,
    temperature_c: float | None = None,
    adds: tuple[str, ...] = (),
    moment_n_m: Any = 0.0,
    tip_force_n: Any = 0.0,
) -> PlannedRun:
    """A run of these shares of the drive, without a clock."""
    history = History.of(
        scale.actuation(share),
        run=name,
        specimen=scale.specimen,
        temperature_c=scale.temperature_c if temperature_c is None else temperature_c,
        base_angles_rad=scale.base_angles_rad if angles is None else angles,
        payload_kg=scale.payload_kg,
        moment_n_m=moment_n_m,
        tip_force_n=tip_force_n,
    )
    return PlannedRun(name, words, history, minutes, adds, needs)
