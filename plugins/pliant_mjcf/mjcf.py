"""MJCF files: read with their errors in words, and prepared with sensors for everything that a study reads."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import mujoco
import numpy as np

from pliant.errors import UserError
from pliant.registry.files import shown
from pliant_mjcf.changes import ModelChange, SpecChange
from pliant_mjcf.places import BODY, FLOOR, GRAVITY, JOINT, TENDON, WORLD
from pliant_plugins.physics.mujoco.warned import silent

# MuJoCo holds kinds as plain integers, which Python finds in a tuple of integers, but not of enum values.
HINGE, SLIDE = int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)
SCALAR_JOINTS = (HINGE, SLIDE)


@dataclass(frozen=True)
class AddedSensor:
    """A sensor that a study reads and the MJCF does not have.

    Attributes:
        kind: word of MJCF: ``jointpos``, ``jointvel``, ``framepos``.
        object: name of the joint or site.
    """

    kind: str
    object: str

    @property
    def name(self) -> str:
        """The name in the compiled model."""
        return f"pliant {self.kind} {self.object}"


def read_spec(path: Path) -> Any:
    """Return the `mujoco.MjSpec` of a file, its unnamed actuators and sensors named after their objects.

    Raises:
        UserError: no such file, no XML, or MuJoCo refuses it.
    """
    try:
        ElementTree.parse(path)
    except (FileNotFoundError, IsADirectoryError):
        raise UserError(f"{shown(path)}: no such file; the MJCF is named from the study's folder.") from None
    except OSError as error:
        raise UserError(f"{shown(path)}: it cannot be read ({error.strerror or error}).") from None
    except ElementTree.ParseError as error:
        raise UserError(f"{shown(path)}: this is not XML ({error}).") from None
    try:
        with silent():
            spec = mujoco.MjSpec.from_file(str(path))
    except ValueError as error:
        raise _refused(path, error) from None
    _name(spec.actuators, lambda one: str(one.target))
    _name(spec.sensors, lambda one: "_".join(filter(None, (str(one.objname), word(one.type)))))
    return spec


def compile_spec(path: Path, spec: Any) -> Any:
    """Return the compiled `mujoco.MjModel`; raise `UserError` where MuJoCo refuses it."""
    try:
        with silent():
            return spec.compile()
    except ValueError as error:
        raise _refused(path, error) from None


def add_sensors(spec: Any, added: Sequence[AddedSensor]) -> None:
    """Add sensors to a specification."""
    for one in dict.fromkeys(added):
        site = one.kind.startswith("frame")
        spec.add_sensor(
            name=one.name,
            type=getattr(mujoco.mjtSensor, f"mjSENS_{one.kind.upper()}"),
            objtype=mujoco.mjtObj.mjOBJ_SITE if site else mujoco.mjtObj.mjOBJ_JOINT,
            objname=one.object,
        )


def changed_model(path: Path, spec: Any, model: Any, changes: Sequence[object]) -> Any:
    """Return the compiled model with all changes of elements, then all of numbers; the arguments stay as they are.

    Raises:
        UserError: MuJoCo refuses the changed elements.
    """
    edits = [one for one in changes if isinstance(one, SpecChange)]
    numbers = [one for one in changes if isinstance(one, ModelChange)]
    if edits:
        spec = spec.copy()
        for edit in edits:
            edit.edit(spec)
        model = compile_spec(path, spec)
    elif numbers:
        model = model.__copy__()
    for number in numbers:
        number.change(model)
    if numbers:
        with silent():
            mujoco.mj_setConst(model, mujoco.MjData(model))
    return model


def element_names(model: Any, place: str) -> dict[str, int]:
    """Return the numbers of the elements where effects of a place can act, by name; without one ``joint_3``.

    Joints are hinges and slides, bodies those that move and have mass.
    """
    if place == JOINT:
        numbers = [k for k in range(model.njnt) if int(model.jnt_type[k]) in SCALAR_JOINTS]
    elif place == TENDON:
        numbers = list(range(model.ntendon))
    else:
        numbers = [k for k in range(model.nbody) if model.body_weldid[k] and model.body_mass[k] > 0.0]
    return {getattr(model, place)(k).name or f"{place}_{k}": k for k in numbers}


def attachments(model: Any) -> dict[str, tuple[str, ...]]:
    """Return the names of places where effects can act: joints of one coordinate, tendons, bodies, the world."""
    found = {place: tuple(element_names(model, place)) for place in (JOINT, TENDON, BODY)}
    return {**found, WORLD: (WORLD,)}


def world_has(model: Any) -> tuple[str, ...]:
    """Return what effects in the world need and the model has: gravity, a floor that can be touched."""
    touched = [bool(a or b) for a, b in zip(model.geom_contype, model.geom_conaffinity, strict=True)]
    floor = any(on and body == 0 for on, body in zip(touched, model.geom_bodyid, strict=True))
    without = model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_GRAVITY)
    gravity = bool(np.any(model.opt.gravity)) and not without
    return (*((GRAVITY,) if gravity else ()), *((FLOOR,) if floor else ()))


def word(kind: Any) -> str:
    """Return the word of MJCF for an enum value: ``jointpos`` for mjSENS_JOINTPOS."""
    return str(kind.name).partition("_")[2].lower()


def names_of(model: Any, what: str) -> list[str]:
    """Return the names of a model's elements: ``names_of(model, "joint")``."""
    count: Mapping[str, int] = {
        "actuator": model.nactuator,
        "sensor": model.nsensor,
        "joint": model.njnt,
        "site": model.nsite,
        "key": model.nkey,
    }
    return [getattr(model, what)(k).name for k in range(count[what])]


def _name(elements: Sequence[Any], wanted: Any) -> None:
    """Name the elements without a name; names stay unique."""
    taken = {str(one.name) for one in elements}
    for one in elements:
        if one.name:
            continue
        base = wanted(one) or word(one.type if hasattr(one, "type") else one.trntype)
        name, k = base, 2
        while name in taken:
            name, k = f"{base}_{k}", k + 1
        one.name = name
        taken.add(name)


def _refused(path: Path, error: ValueError) -> UserError:
    lines = [line.strip() for line in str(error).splitlines() if line.strip()] or ["no reason is given"]
    where = f" ({lines[1]})" if len(lines) > 1 and "line" in lines[1] else ""
    return UserError(f"{shown(path)}: MuJoCo does not read it: {lines[0].removeprefix('Error: ')}{where}.")
