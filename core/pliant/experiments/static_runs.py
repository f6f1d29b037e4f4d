"""The default menu of a bench without a clock: states that are reached slowly, one row each.

Nothing in it depends on time: the drive's levels under other loads, orientations and temperatures, and with more
sensors. `minutes` are those of setting up, as no motion is timed.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pliant.experiments.menu import MenuRun
from pliant.experiments.runs import HEATING, LOADING, MOUNTING, TURNING, WARMER_K, second_outputs
from pliant.experiments.scale import BenchScale
from pliant.records.design import Array
from pliant.records.history import History

LEVELS = (0.0, 0.25, 0.5, 0.75, 1.0)
PUSHES = (-1.0, -0.5, 0.0, 0.5, 1.0)
PUSHED_AT = 0.6
TURNED = {
    "level": ("the base horizontal", (0.0, np.pi / 2, 0.0)),
    "upside_down": ("upside down", (0.0, np.pi, 0.0)),
    "sideways": ("the base rolled to its side, out of the plane of bending", (np.pi / 2, 0.0, 0.0)),
}


def static_menu(scale: BenchScale) -> tuple[MenuRun, ...]:
    """All runs of this menu that make sense for this chain."""
    levels, pushes = np.array(LEVELS), np.array(PUSHES)
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
) -> MenuRun:
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
    return MenuRun(name, words, history, minutes, adds, needs)
