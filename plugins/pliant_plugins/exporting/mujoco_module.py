"""The Python module of an exported MJCF: the laws as NumPy functions, tables of joints and inputs, and the driver."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources
from pprint import pformat
from typing import Any

import numpy as np

from pliant.mechanics.kinematics import ChainGeometry
from pliant.records.chain import ChainModel
from pliant.records.law import EXTENSIBLE_AXES, EXTENSION, JointLaw
from pliant_export.in_python import NUMPY, function_text, table_text
from pliant_export.written_law import WrittenLaw, written
from pliant_plugins.physics.mujoco.mjcf import JOINT_TYPES
from pliant_plugins.physics.mujoco.mount import ONE_COORDINATE, MountedArm

MARK = "# Filled in by the export"
BEGIN = "# --- the driver"


@dataclass(frozen=True)
class DrivenArm:
    """A chain in the file; the names of its joints and inputs begin with the prefix."""

    chain: ChainModel
    prefix: str = ""


def module_text(arms: Sequence[DrivenArm], mjcf: str) -> str:
    """Return the text of the module that drives the arms of the file `mjcf`.

    Raises:
        UserError: a law that cannot be written.
    """
    laws: list[JointLaw] = list(dict.fromkeys(law for arm in arms for law in arm.chain.laws))
    forms = [written(law, f"law_{k}") for k, law in enumerate(laws)]
    driver = resources.files("pliant_plugins.exporting.alone").joinpath("mujoco_driver.py").read_text("utf-8")
    head, rest = driver.split(MARK, 1)
    driver = BEGIN + rest.split(BEGIN, 1)[1]
    domains = ", ".join(_domain(form) for form in forms)
    lists = [
        f"MJCF = {mjcf!r}",
        f"START = {_start(arms)!r}",
        f"LAWS = [{', '.join(form.name for form in forms)}]",
        f"TAKES = {[form.m for form in forms]}",
        f"DOMAINS = [{domains}]",
        "ARMS = " + pformat([_arm(arm, laws) for arm in arms], width=110, compact=True, sort_dicts=False),
    ]
    tables = [f"TABLE_{k} = {table_text(form.tape)}" for k, form in enumerate(forms) if len(form.tape.table)]
    functions = [function_text(form, NUMPY, f"TABLE_{k}") for k, form in enumerate(forms)]
    about = [f"# {form.name}: {line}" for form in forms for line in form.about]
    middle = "\n".join(about) + "\n\n" + "\n".join(tables) + "\n\n\n" + "\n\n\n".join(functions)
    return head + middle + "\n\n\n" + "\n".join(lists) + "\n\n" + driver


def _start(arms: Sequence[DrivenArm]) -> dict[str, dict[str, float]]:
    """Return the initial state of the arm that carries the robot: joints of one coordinate and commands, by name."""
    mount = arms[0].chain.mount
    if mount is None:
        return {"joints": {}, "ctrl": {}}
    arm = MountedArm.from_mount(mount)
    model = arm.model
    joints = {
        model.joint(k).name: float(arm.qpos[model.jnt_qposadr[k]])
        for k in range(model.njnt)
        if int(model.jnt_type[k]) in ONE_COORDINATE and model.joint(k).name
    }
    ctrl = {model.actuator(k).name: float(arm.ctrl[k]) for k in range(model.nu) if model.actuator(k).name}
    return {"joints": joints, "ctrl": ctrl}


def _arm(arm: DrivenArm, laws: Sequence[JointLaw]) -> dict[str, Any]:
    chain = arm.chain
    a, geometry = len(chain.axes), ChainGeometry.from_chain(chain)
    ball = JOINT_TYPES[geometry.kind][0] == "ball"
    of_joint = [
        (laws.index(chain.laws[joint.law]), _drives(chain, k)) for k, joint in enumerate(chain.joints)
    ]
    return {
        "joints": [f"{arm.prefix}joint_{k + 1}" for k in range(chain.n_joints)],
        "ball": ball,
        "slides": chain.axes[-1] == EXTENSION,  # behind each ball; its coordinate is the last
        "axes": [EXTENSIBLE_AXES.index(axis) for axis in chain.axes] if ball else [0],
        "reach": geometry.relative_reach.tolist(),
        "inputs": [arm.prefix + actuator.input for actuator in chain.actuators],
        "turns": [actuator.turn(a).tolist() for actuator in chain.actuators],
        "groups": [
            {
                "law": law,
                "joints": [k for k, known in enumerate(of_joint) if known == (law, drives)],
                "drives": list(drives),
            }
            for law, drives in sorted(set(of_joint))
        ],
    }


def _drives(chain: ChainModel, joint: int) -> tuple[int, int]:
    """Return first and last (exclusive) of the actuators that act on a joint."""
    own = getattr(chain.joints[joint], "drives", None)
    return own or (0, len(chain.actuators))


def _domain(form: WrittenLaw) -> str:
    rows = np.where(np.isfinite(form.domain), form.domain, np.sign(form.domain) * 1e300).tolist()
    return f"np.array({rows})"
