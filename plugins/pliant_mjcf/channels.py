"""Channels of a MuJoCo model: columns of a recording that drive actuators or read sensors."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from pliant.errors import UserError, closest
from pliant.interfaces.model import Channel
from pliant.records.design import Array
from pliant.units import UNIT_SUFFIXES, split_unit
from pliant_mjcf.config import MjcfModelConfig
from pliant_mjcf.mjcf import SCALAR_JOINTS, AddedSensor, names_of
from pliant_mjcf.quantities import component_names, control_unit, joint_unit, sensor_unit

SUFFIX = {unit: suffix for suffix, unit in UNIT_SUFFIXES.items()}
# A curve is continued by this share of its range at both ends: the noise of a pressure sensor at zero.
BEYOND_CURVE = 0.05
# Units that a recording may have, and a channel may not → the ending of its name.
OTHER_UNITS = {
    **dict.fromkeys(("deg", "degrees", "mrad"), "rad"),
    **dict.fromkeys(("mm", "cm", "um"), "m"),
    **dict.fromkeys(("kpa", "mpa", "hpa", "bar", "mbar", "psi"), "pa"),
    **dict.fromkeys(("mn", "kn"), "n"),
    "mnm": "n_m",
    "nm": "n_m",
}
RESERVED = ("run", "specimen", "time_s", "time")


@dataclass(frozen=True)
class Driven:
    """An input: its channel, the actuator's index, and the points of its curve, empty for ctrl itself."""

    channel: Channel
    actuator: int
    curve: tuple[tuple[float, float], ...] = ()

    def control(self, values: Array) -> Array:
        """Return (t,) ctrl for the channel's values; the curve's first and last lines continue beyond its ends."""
        if not self.curve:
            return values
        x, y = np.array(self.curve).T
        k = np.clip(np.searchsorted(x, values, side="right") - 1, 0, len(x) - 2)
        return np.asarray(y[k] + (values - x[k]) * (y[k + 1] - y[k]) / (x[k + 1] - x[k]))


@dataclass(frozen=True)
class Read:
    """An output: its channel, the sensor's name and which of its numbers, and the joint whose state it is, if any.

    Attributes:
        joint: name of the joint of one coordinate that the sensor reads; "" for other sensors.
        of_velocity: whether it reads the joint's velocity instead of its position.
    """

    channel: Channel
    sensor: str
    component: int = 0
    joint: str = ""
    of_velocity: bool = False


def driven_inputs(where: str, config: MjcfModelConfig, model: Any) -> tuple[Driven, ...]:
    """Return the inputs of a model, in the order of its actuators.

    Raises:
        UserError: no actuator, an unknown one, one that two columns drive, or one that is an input and fixed.
    """
    names = names_of(model, "actuator")
    if not names:
        raise UserError(
            f"{where}: the model has no actuator, so that no input can drive it; add a motor or position."
        )
    for k, name in enumerate(names):
        if model.actuator_ctrlnum[k] != 1 or model.actuator_outnum[k] != 1:
            raise UserError(
                f"{where}: actuator '{name}' has {model.actuator_ctrlnum[k]} controls; each actuator needs one number."
            )
    for key, wanted in (
        ("inputs", [one.actuator for one in config.inputs.values()]),
        ("fixed", list(config.fixed)),
    ):
        for name in wanted:
            if name not in names:
                raise UserError(f"{where}: '{key}' names actuator '{name}'; {_known(name, names)}")
    columns: dict[str, str] = {}
    for column, source in config.inputs.items():
        if source.actuator in columns or source.actuator in config.fixed:
            other = columns.get(source.actuator, "")
            twice = f"'{other}' and '{column}' both drive" if other else f"'{column}' drives the fixed"
            raise UserError(f"{where}: {twice} actuator '{source.actuator}'; keep one.")
        columns[source.actuator] = column
    free = [name for name in names if name not in config.fixed]
    if not free:
        raise UserError(
            f"{where}: every actuator is fixed, so that no input is left; take one out of 'fixed'."
        )
    return tuple(_driven(config, model, name, columns.get(name)) for name in free)


def check_units(where: str, columns: Sequence[str]) -> None:
    """Raise `UserError` for a column named by a study with a unit that is not SI: a recording's column is converted."""
    for column in columns:
        stem, _, word = column.lower().rpartition("_")
        if stem and word in OTHER_UNITS:
            raise UserError(
                f"{where}: the study names a column '{column}', and its columns are in SI; write "
                f"'{column[: len(stem)]}_{OTHER_UNITS[word]}'. The recording may keep its unit and its name."
            )


def _driven(config: MjcfModelConfig, model: Any, name: str, column: str | None) -> Driven:
    k = model.actuator(name).id
    curve = () if column is None else config.inputs[column].curve
    unit = "" if curve else control_unit(model, k)
    channel, unit = (column, split_unit(column)[1] or unit) if column else with_unit(name, unit)
    low, high = model.actuator_ctrlrange[k] if model.actuator_ctrllimited[k] else (None, None)
    if curve:
        slack = BEYOND_CURVE * (curve[-1][0] - curve[0][0])
        low, high = curve[0][0] - slack, curve[-1][0] + slack
    ends = [None if end is None else float(end) for end in (low, high)]
    return Driven(Channel(channel, unit, f"actuator '{name}'", *ends), k, curve)


def read_outputs(
    where: str, config: MjcfModelConfig, model: Any
) -> tuple[tuple[Read, ...], tuple[AddedSensor, ...]]:
    """Return the outputs of a model, and the sensors that it needs for them.

    Raises:
        UserError: no sensor and no output, or a source that the model does not have.
    """
    if not config.outputs:
        found = [one for name in names_of(model, "sensor") for one in _sensor_channel(model, name, "")]
        if not found:
            raise UserError(
                f"{where}: the model has no sensor; add one, or name outputs in the study: 'outputs: "
                "{elbow_rad: elbow, tip: tip}' reads a joint and a site."
            )
        return tuple(found), ()
    reads: list[Read] = []
    added: list[AddedSensor] = []
    for column, source in config.outputs.items():
        some, sensor = _source_channel(where, model, column, source)
        reads += some
        added += [] if sensor is None else [sensor]
    return tuple(reads), tuple(added)


def _source_channel(
    where: str, model: Any, column: str, source: str
) -> tuple[Sequence[Read], AddedSensor | None]:
    """Return what a column reads: a sensor, a joint or a site, whole or one component of it."""
    known = {what: names_of(model, what) for what in ("sensor", "joint", "site")}
    kind, colon, rest = source.partition(":")
    meant = [kind] if colon and kind in known else list(known)
    source = rest if colon and kind in known else source
    for name, component in ((source, ""), source.rpartition(".")[::2]):
        for what in meant:
            if not name or name not in known[what]:
                continue
            if what == "sensor":
                return _chosen(where, column, source, _sensor_channel(model, name, column), component), None
            if what == "site":
                sensor = AddedSensor("framepos", name)
                axes = [
                    _vector(column, sensor.name, f"site '{name}'", "m", k, a) for k, a in enumerate("xyz")
                ]
                return _chosen(where, column, source, axes, component), sensor
            if component in ("", "position", "velocity"):
                return _joint_channel(where, model, column, name, component == "velocity")
    every = [name for what in meant for name in known[what] if name]
    raise UserError(
        f"{where}: 'outputs' has '{column}: {source}'; {_known(source.partition('.')[0], every)} A component follows a "
        "point: 'tip.x', 'elbow.velocity'."
    )


def _joint_channel(
    where: str, model: Any, column: str, name: str, velocity: bool
) -> tuple[list[Read], AddedSensor]:
    k = model.joint(name).id
    if int(model.jnt_type[k]) not in SCALAR_JOINTS:
        raise UserError(
            f"{where}: 'outputs' has '{column}: {name}', a ball or free joint; read a site or a sensor instead."
        )
    length = joint_unit(model, k)
    sensor = AddedSensor("jointvel" if velocity else "jointpos", name)
    unit = f"{length}/s" if velocity else length
    label = f"joint '{name}'"
    channel = Channel(column, split_unit(column)[1] or unit, label)
    return [Read(channel, sensor.name, 0, name, velocity)], sensor


def _sensor_channel(model: Any, name: str, column: str) -> list[Read]:
    """Return the channels of a sensor, named after it or after a study's column."""
    k = model.sensor(name).id
    kind = mujoco.mjtSensor(int(model.sensor_type[k]))
    unit, label = sensor_unit(model, k), f"sensor '{name}'"
    parts = component_names(kind, int(model.sensor_dim[k]))
    if len(parts) == 1:
        channel, unit = (column, split_unit(column)[1] or unit) if column else with_unit(name, unit)
        velocity = kind == mujoco.mjtSensor.mjSENS_JOINTVEL
        of_joint = velocity or kind == mujoco.mjtSensor.mjSENS_JOINTPOS
        joint = model.joint(int(model.sensor_objid[k])).name if of_joint else ""
        return [Read(Channel(channel, unit, label), name, 0, joint, velocity)]
    return [_vector(column or name, name, label, unit, i, part) for i, part in enumerate(parts)]


def _vector(stem: str, sensor: str, label: str, unit: str, k: int, part: str) -> Read:
    """Return one component of a vector: ``tip`` or ``tip_m`` gives ``tip_x_m``."""
    plain, own = split_unit(stem)
    name = f"{plain}_{part}{stem.removeprefix(plain)}" if own else f"{stem}_{part}"
    channel, unit = with_unit(name, own or unit)
    return Read(Channel(channel, unit, f"{label}, {part}"), sensor, k)


def _chosen(where: str, column: str, source: str, reads: Sequence[Read], component: str) -> list[Read]:
    """Return all components, or the one that the source names under the column's own name."""
    if not component:
        return list(reads)
    parts = [one.channel.label.rpartition(", ")[2] for one in reads] if len(reads) > 1 else []
    if component not in parts:
        has = f"it has {', '.join(parts)}" if parts else "it is one number, without components"
        raise UserError(f"{where}: 'outputs' has '{column}: {source}', which has no '{component}'; {has}.")
    one = reads[parts.index(component)]
    unit = split_unit(column)[1] or one.channel.unit
    return [Read(Channel(column, unit, one.channel.label), one.sensor, one.component)]


def with_unit(name: str, unit: str) -> tuple[str, str]:
    """Return a column's name for an element of the MJCF, with its unit at the end where names can say it.

    A name that already ends with a unit stays; other signs than letters, digits and _ become _.
    """
    plain = re.sub(r"\W+", "_", name, flags=re.ASCII).strip("_") or "unnamed"
    own = split_unit(plain)[1]
    if own:
        return plain, own
    return plain + SUFFIX.get(unit, ""), unit


def check_unique(where: str, channels: Sequence[Channel]) -> None:
    """Raise `UserError` for names that a table cannot distinguish, or that it uses for something else."""
    lower = Counter(channel.name.lower() for channel in channels)
    for channel in channels:
        name = channel.name.lower()
        if name in RESERVED:
            raise UserError(
                f"{where}: {channel.label} gives a column '{channel.name}', which tables use for something "
                "else; rename it."
            )
        if lower[name] > 1:
            both = " and ".join(one.label for one in channels if one.name.lower() == name)
            raise UserError(
                f"{where}: {both} give the same column '{channel.name}'; rename one, or name the columns by 'inputs' "
                "and 'outputs'."
            )


def _known(name: str, names: Sequence[str]) -> str:
    """Return which names the model has, with the closest."""
    near = closest(name, names)
    return f"the model has {', '.join(filter(None, names)) or 'none'}{near}"
