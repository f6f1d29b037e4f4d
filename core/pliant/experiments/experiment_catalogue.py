"""The runs of the default menu, and those of a study's `protocols`, ready to be chosen and written to a file."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pliant.config.protocols import Level, ProtocolConfig
from pliant.config.study import Study
from pliant.errors import UserError, closest
from pliant.evidence.measured_model import MeasuredModel
from pliant.evidence.prediction import Predictor
from pliant.experiments.planned_run import (
    NEW,
    SET_UP,
    STEP_S,
    BenchScale,
    PlannedRun,
    RunMaker,
    RunShape,
    corners,
    dense_steps,
    steps,
)
from pliant.records.design import Array
from pliant.records.history import History
from pliant.units import UnitError, parse_quantity

SLOW_STEP_S, FINE_STEP_S, STEP_RISE_S = 1.0, 0.02, 0.3
MEDIUM_S, SLOW_S, FAST_S = 20.0, 80.0, 4.0
TWICE = (1.0, 1.0)
RISING = (0.3, 0.3, 0.6, 0.6, 1.0, 1.0)
# A large loop with small ones inside, each reversed before its end.
LOOPS = (0.0, 1.0, 0.4, 0.8, 0.3, 0.7, 0.0, 0.6, 0.2, 0.5, 0.0)
PUSHES = (0.0, 1.0, 0.0, -1.0, 0.5, 0.0)
PAYLOADS = (0.0, 0.5, 1.0)  # shares of the payload at the tip
NUMBERS = {1: "one", 2: "two", 3: "three"}
WARMER_K = 15.0
LOADING, TURNING, MOUNTING, HEATING = 3.0, 5.0, 10.0, 15.0
MOST_ANGLES = 12
TENDON, PAID_OUT = "tendon_", 0.5
UNITS = {"_pa": "Pa", "_n": "N", "_m": "m"}
# For a recording without time.
STATIC_LEVELS = (0.0, 0.25, 0.5, 0.75, 1.0)
STATIC_PUSHES = (-1.0, -0.5, 0.0, 0.5, 1.0)
PUSHED_AT = 0.6
# Rotated bases, by name: in words, roll, pitch and yaw.
TURNED = {
    "level": ("the base horizontal", (0.0, np.pi / 2, 0.0)),
    "upside_down": ("upside down", (0.0, np.pi, 0.0)),
    "sideways": ("the base rolled to its side, out of the plane of bending", (np.pi / 2, 0.0, 0.0)),
}
TURNTABLE, CHAMBER = "a bench whose base can be turned", "a warm chamber and a thermometer"
WEIGHTS, LEVER = "weights or a lever", "a lever with a load cell"
MASSES = "weights that were weighed"
CAMERA = "a camera or a tracker"


def timed_catalogue(scale: BenchScale) -> tuple[PlannedRun, ...]:
    """Return all runs of the default menu that are possible for this chain."""
    make = RunMaker(scale)
    builders = [build for name, build in BUILDERS.items() if name in OF_HELD or not scale.is_held]
    return tuple(run for build in builders if (run := build(make, RunShape())) is not None)


def slow_cycles(make: RunMaker, shape: RunShape) -> PlannedRun:
    """Return slow cycles, whose rates differ widely from those of `fast_cycles`."""
    words = f"cycle slowly, {shape.period_s or SLOW_S:g} s per cycle{_times(shape, 2)}"
    return make.run("slow_cycles", words, make.cycles(shape, SLOW_S, TWICE))


def fast_cycles(make: RunMaker, shape: RunShape) -> PlannedRun:
    """Return fast cycles, which excite viscous resistance and delays."""
    words = f"cycle quickly, {shape.period_s or FAST_S:g} s per cycle{_times(shape, 15)}"
    return make.run("fast_cycles", words, make.cycles(shape, FAST_S, (1.0,) * 15))


def each_input(make: RunMaker, shape: RunShape) -> PlannedRun | None:
    """Return a run of every input alone and of all together, which separates their effects and their interaction.

    Two inputs with a law each are separated by `slow_cycles`, which drives them in turn.
    """
    scale = make.scale
    driven = scale.driven
    own_laws = all(len(law.actuations) == 1 for law in scale.chain.laws)
    if len(driven) < (3 if own_laws else 2):
        return None
    period = shape.period_s or MEDIUM_S
    wave = make.cycles(replace(shape, cycles=len(driven) + 1), period, TWICE, one_way=True)
    phase = np.minimum(wave.time_s / period, len(driven)).astype(int)
    acting = {
        name: scale.top[name] * wave.share * ((phase == driven.index(name)) | (phase == len(driven)))
        if name in driven
        else np.zeros(len(wave))
        for name in scale.top
    }
    words = f"one medium cycle of each of {', '.join(driven)} alone, then one of all of them together"
    return make.run("each_input", words, wave, inputs=acting)


def paid_out(make: RunMaker, shape: RunShape) -> PlannedRun | None:
    """Return a run in which every tendon in turn is pulled and then paid out, which shows whether it goes slack."""
    scale = make.scale
    driven = [name for name in scale.driven if name.startswith(TENDON)]
    if not driven:
        return None
    period = shape.period_s or MEDIUM_S
    wave = make.cycles(replace(shape, cycles=2 * len(driven)), period / 2, TWICE, one_way=True)
    half = np.minimum(2.0 * wave.time_s / period, 2 * len(driven) - 1).astype(int)
    acting = {
        name: scale.top[name]
        * wave.share
        * np.where(half % 2, -PAID_OUT, 1.0)
        * (half // 2 == driven.index(name))
        if name in driven
        else np.zeros(len(wave))
        for name in scale.top
    }
    words = f"each of {', '.join(driven)} alone: pull it, then pay it out by half as much"
    return make.run("paid_out", words, wave, inputs=acting)


def small_loops(make: RunMaker, shape: RunShape) -> PlannedRun:
    """Return small loops, whose reversals excite friction and hysteresis."""
    way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(LOOPS)))]) * (shape.period_s or MEDIUM_S) / 2
    wave = corners(list(zip(np.round(way * 2) / 2, LOOPS, strict=True)), STEP_S)
    words = "small loops inside a large one at a medium rate: turn back before the ends"
    return make.run("small_loops", words, wave)


def holds(make: RunMaker, shape: RunShape) -> PlannedRun:
    """Return constant levels, which excite relaxation, and its recovery after venting."""
    hold = shape.hold_s or 60.0
    wave = steps((*(shape.levels or (0.4, 0.8, 1.0)), 0.0), hold, min(SLOW_STEP_S, hold / 8))
    words = f"raise the drive in steps, hold each for {hold:g} s, release and keep recording"
    return make.run("holds", words, wave)


def virgin(make: RunMaker, shape: RunShape) -> PlannedRun:
    """Return cycles of a new specimen, which show permanent changes by the first loading."""
    wave = make.cycles(shape, MEDIUM_S, RISING)
    words = "a new specimen, amplitude rising from cycle to cycle, each amplitude twice"
    needs = "a second specimen of the same make"
    return make.run("virgin", words, wave, MOUNTING, specimen=NEW, needs=needs)


def _turned(name: str) -> Callable[[RunMaker, RunShape], PlannedRun]:
    def build(make: RunMaker, shape: RunShape) -> PlannedRun:
        words, angles = TURNED[name]
        wave = make.cycles(shape, MEDIUM_S, TWICE)
        n = len(shape.amplitudes) or shape.cycles or 2
        order = f"{words}, {NUMBERS.get(n, n)} medium cycle{'s' * (n > 1)}"
        return make.run(name, order, wave, TURNING, base_angles_rad=angles, needs=TURNTABLE)

    return build


def warm(make: RunMaker, shape: RunShape) -> PlannedRun:
    """Return two medium cycles at another temperature."""
    usual = make.scale.temperature_c
    there = usual + WARMER_K if shape.temperature_c is None else shape.temperature_c
    words = f"at {there:g} °C, {there - usual:g} K warmer, two medium cycles"
    wave = make.cycles(shape, MEDIUM_S, TWICE)
    return make.run("warm", words, wave, HEATING, temperature_c=there, needs=CHAMBER)


def _loaded(name: str, words: str) -> Callable[[RunMaker, RunShape], PlannedRun]:
    def build(make: RunMaker, shape: RunShape) -> PlannedRun:
        hold = shape.hold_s or MEDIUM_S
        passive = name == "passive_load_steps"
        share = 0.0 if passive else shape.levels[0] if shape.levels else PUSHED_AT
        pushes = steps(PUSHES, hold, min(STEP_S, hold / 8), rise_s=min(1.0, hold / 4))
        pushed: dict[str, Any] = make.scale.loads(pushes.share)
        if shape.load_n_m is not None:
            pushed = {"moment_n_m": shape.load_n_m * pushes.share}
        order = f"{words.format(drive=make.scale.drive)}, load steps of both signs"
        drive = replace(pushes, share=np.full(len(pushes), share))
        return make.run(name, order, drive, LOADING, needs=WEIGHTS, **pushed)

    return build


def payload_steps(make: RunMaker, shape: RunShape) -> PlannedRun | None:
    """Return a run with no payload, half and all of it; None for a chain without a payload or a held one."""
    scale = make.scale
    whole = scale.payload_kg if scale.payload_kg else scale.chain.payload_kg
    if not whole or scale.is_held:
        return None
    period = shape.period_s or MEDIUM_S
    wave = make.cycles(replace(shape, cycles=len(PAYLOADS)), period, TWICE)
    cycle = np.minimum(wave.time_s / period, len(PAYLOADS) - 1).astype(int)
    words = "one medium cycle with no payload, one with half of it and one with all of it"
    return make.run(
        "payload_steps", words, wave, LOADING, needs=MASSES, payload_kg=whole * np.array(PAYLOADS)[cycle]
    )


def blocked(make: RunMaker, shape: RunShape) -> PlannedRun | None:
    """Return a run of the drive's torque alone: the load that keeps the joint at zero."""
    hold = shape.hold_s or 15.0
    levels = shape.levels or (0.25, 0.5, 0.75, 1.0)
    wave = steps((*levels, 0.0), hold, min(STEP_S, hold / 8), rise_s=hold / 3)
    moment = make.scale.blocking_moment(make.scale.actuation(wave.share))
    if moment is None:
        return None
    words = f"at {len(levels)} levels of the drive, the load that brings the angle back to zero; read the angle left"
    return make.run("blocked", words, wave, TURNING, moment_n_m=moment, needs=LEVER)


def vented_zero(make: RunMaker, shape: RunShape) -> PlannedRun:
    """Return a run of zeros between cycles, which shows the residual and whether it recovers."""
    hold = shape.hold_s or 30.0
    rise = MEDIUM_S / 2
    ways = [(rise, 1.0), (rise, 0.0), (hold, 0.0), (rise, 1.0), (hold, 1.0), (rise, 0.0), (2 * hold, 0.0)]
    times = np.concatenate([[0.0], np.cumsum([span for span, _ in ways])])
    wave = corners(list(zip(times, [0.0, *(share for _, share in ways)], strict=True)), STEP_S)
    words = f"cycle, vent and read the zero for {hold:g} s; hold the top as long, vent and read the zero twice as long"
    return make.run("vented_zero", words, wave)


def closed_valve(make: RunMaker, shape: RunShape) -> PlannedRun | None:
    """Return a run with closed valves, which shows the interaction of the specimen with the enclosed air."""
    if make.scale.drive != "pressure":
        return None
    hold, fill, rest = shape.hold_s or 60.0, 2.0, 8.0
    points, spans, now = [(0.0, 0.0)], [], 0.0
    for level in shape.levels or (0.6, 1.0):
        closed_at = now + fill + rest  # the chamber has reached the supply's pressure before the valve closes
        points += [(now + fill, level), (closed_at + hold, level), (closed_at + hold + fill, 0.0)]
        spans.append((closed_at, closed_at + hold))
        now = closed_at + hold + fill + rest
        points.append((now, 0.0))
    wave = corners(points, min(STEP_S, hold / 8))
    closed = np.any([(wave.time_s > low) & (wave.time_s <= high) for low, high in spans], axis=0)
    words = f"fill to {len(spans)} levels, close the valve at each and record for {hold:g} s"
    valve = np.where(closed, 0.0, 1.0)
    return make.run("closed_valve", words, wave, valve_open=valve, needs="a valve at the specimen")


def step_response(make: RunMaker, shape: RunShape) -> PlannedRun:
    """Return steps, whose first second shows delays."""
    hold = shape.hold_s or 4.0
    levels, fine = (*(shape.levels or (0.6, 0.0, 1.0)), 0.0), min(1.0, hold / 2)
    wave = dense_steps(levels, hold, STEP_RISE_S, FINE_STEP_S, fine, 0.2)
    words = f"steps within {STEP_RISE_S:g} s, sampled densely (50 Hz) for {fine:g} s after each"
    return make.run("step_response", words, wave, needs="a recorder of 50 Hz")


def second_sensor(make: RunMaker, shape: RunShape) -> PlannedRun:
    """Return two medium cycles with a second sensor, to compare it with the first."""
    wave = make.cycles(shape, MEDIUM_S, TWICE)
    words = "two medium cycles with the tip's position and every joint's angle read too"
    return make.run("second_sensor", words, wave, MOUNTING, adds=second_outputs(make.scale), needs=CAMERA)


def second_outputs(scale: BenchScale) -> tuple[str, ...]:
    """Return the tip's position, and the angles of the joints if there are several."""
    n = scale.chain.n_joints
    bends = scale.chain.laws[0].joint != "prismatic"
    angles = [f"joint_{k + 1}_angle_rad" for k in range(n)] if bends and 1 < n <= MOST_ANGLES else []
    return ("tip_x_m", "tip_y_m", "tip_z_m", *angles)


def _times(shape: RunShape, usual: int) -> str:
    n = len(shape.amplitudes) or shape.cycles or usual
    return {1: ", once", 2: ", twice"}.get(n, f", {n} times")


BUILDERS: Mapping[str, Callable[[RunMaker, RunShape], PlannedRun | None]] = {
    "slow_cycles": slow_cycles,
    "fast_cycles": fast_cycles,
    "each_input": each_input,
    "paid_out": paid_out,
    "small_loops": small_loops,
    "holds": holds,
    "virgin": virgin,
    **{name: _turned(name) for name in TURNED},
    "warm": warm,
    "passive_load_steps": _loaded("passive_load_steps", "no {drive}"),
    "load_steps": _loaded("load_steps", "constant {drive}"),
    "payload_steps": payload_steps,
    "blocked": blocked,
    "vented_zero": vented_zero,
    "closed_valve": closed_valve,
    "step_response": step_response,
    "second_sensor": second_sensor,
}


# Runs that are possible for a held joint: those that neither load it nor rotate its base.
OF_HELD = ("slow_cycles", "fast_cycles", "small_loops", "holds", "virgin", "warm", "vented_zero")


def static_catalogue(scale: BenchScale) -> tuple[PlannedRun, ...]:
    """Return all runs without a clock that are possible for this chain."""
    make, runs = RunMaker(scale), []
    levels, pushes = np.array(STATIC_LEVELS), np.array(STATIC_PUSHES)
    if scale.both_ways:
        levels = np.concatenate([-levels[:0:-1], levels])
    count = f"{len(levels)} levels of the {scale.drive}"

    def add(name: str, words: str, minutes: float, needs: str, share: Array = levels, **more: Any) -> None:
        runs.append(make.run(name, words, share, minutes, needs=needs, **more))

    for name, (words, angles) in TURNED.items():
        add(name, f"{words}, {count}", TURNING, TURNTABLE, base_angles_rad=angles)
    there = scale.temperature_c + WARMER_K
    words = f"at {there:g} °C, {WARMER_K:g} K warmer, {count}"
    add("warm", words, HEATING, CHAMBER, temperature_c=there)
    for name, share, drive in (("passive_load_steps", 0.0, "no"), ("load_steps", PUSHED_AT, "constant")):
        order = f"{drive} {scale.drive}, {len(pushes)} loads of both signs"
        add(name, order, LOADING, WEIGHTS, np.full(len(pushes), share), **scale.loads(pushes))
    moment = scale.blocking_moment(scale.actuation(levels))
    if moment is not None:
        words = f"at {count}, the load that brings the angle back to zero; read the angle left"
        add("blocked", words, TURNING, LEVER, moment_n_m=moment)
    if scale.is_held:
        return tuple(run for run in runs if run.name in OF_HELD)
    words = f"{count} with the tip's position and every joint's angle read too"
    add("second_sensor", words, MOUNTING, CAMERA, adds=second_outputs(scale))
    return tuple(runs)


def own_runs(study: Study, model: MeasuredModel) -> tuple[PlannedRun, ...]:
    """Return the runs of a study's `protocols`, at the scale of the model's measurement; empty without such a block.

    Raises:
        UserError: a run that the model cannot do.
    """
    if not study.protocols:
        return ()
    if not isinstance(model, Predictor):
        raise UserError(f"study '{study.name}': 'protocols' are runs of a chain of modules; leave them out.")
    return planned_runs(study.protocols, BenchScale.from_measurement(model.chain, model.measurement))


def planned_runs(protocols: Sequence[ProtocolConfig], scale: BenchScale) -> tuple[PlannedRun, ...]:
    """Return the runs of the block, or the default menu if it is empty.

    Raises:
        UserError: a run that this chain cannot do, a level in another unit, or a name that occurs twice.
    """
    if not protocols:
        return timed_catalogue(scale)
    found: list[PlannedRun] = []
    for number, config in enumerate(protocols):
        where = f"protocols[{number}]"
        run = _custom(config, scale, where) if config.run == "custom" else _menu_run(config, scale, where)
        name = config.name or run.name
        if any(name == other.name for other in found):
            raise UserError(f"'protocols' has run '{name}' twice; give one of them another 'name'.")
        words, minutes = config.words or run.words, run.minutes if config.minutes is None else config.minutes
        found.append(
            replace(run, name=name, words=words, minutes=minutes, history=run.history.with_(run=name))
        )
    return tuple(found)


def _menu_run(config: ProtocolConfig, scale: BenchScale, where: str) -> PlannedRun:
    lead = max(scale.top, key=lambda name: scale.top[name])

    def shares(levels: Sequence[Level]) -> tuple[float, ...]:
        most = scale.top[lead] or 1.0
        return tuple(_value(v, lead, where) / most if isinstance(v, str) else float(v) for v in levels)

    shape = RunShape(
        config.period_s,
        shares(config.amplitudes),
        config.cycles,
        shares(config.levels),
        config.hold_s,
        config.load_n_m,
        config.temperature_c,
    )
    run = BUILDERS[config.run](RunMaker(scale), shape)
    if run is None:
        raise UserError(f"{where}: run '{config.run}' makes no sense for this chain; leave it out.")
    return run


def _value(level: Level, name: str, where: str) -> float:
    if not isinstance(level, str):
        return float(level)
    unit = next(unit for suffix, unit in UNITS.items() if name.endswith(suffix))
    try:
        return parse_quantity(level, unit)
    except UnitError as error:
        raise UserError(f"{where}: {error}; the chain is driven by {name}.") from None


def _custom(config: ProtocolConfig, scale: BenchScale, where: str) -> PlannedRun:
    for name in config.inputs:
        if name not in scale.top:
            raise UserError(
                f"{where}: '{name}' is not an input of this chain{closest(name, list(scale.top))} "
                f"It is driven by {', '.join(scale.top)}."
            )

    def sampled(values: Sequence[float]) -> Array:
        return corners(list(zip(config.times_s, values, strict=True)), STEP_S).share

    clock = corners([(time, 0.0) for time in config.times_s], STEP_S).time_s
    still = [0.0] * len(config.times_s)
    driven = {name: [_value(v, name, where) for v in config.inputs.get(name, still)] for name in scale.top}
    turned = config.pitch_rad != 0.0 or config.roll_rad != 0.0
    changes: dict[str, Any] = {"specimen": NEW} if config.new_specimen else {}
    if config.moments_n_m:
        changes["moment_n_m"] = sampled(config.moments_n_m)
    if config.temperature_c is not None:
        changes["temperature_c"] = config.temperature_c
    if turned:
        changes["base_angles_rad"] = (config.roll_rad, config.pitch_rad, 0.0)
    name = config.name or "custom"
    inputs = {key: sampled(values) for key, values in driven.items()}
    history = History.from_arrays(inputs, clock, run=name, **{**scale.usual, **changes})
    words = config.words or f"the run '{config.name}' of the study's protocols"
    minutes = (TURNING if turned else SET_UP) + float(clock[-1]) / 60.0
    return PlannedRun(name, words, history, round(minutes, 1))
