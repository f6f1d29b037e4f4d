"""Small MJCF files for tests, and runs that drive them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pliant.interfaces.model import Drive, SystemParts, SystemReadings
from pliant.records.history import History
from pliant_mjcf.config import MjcfModelConfig
from pliant_mjcf.model import MjcfModel

# A point of 1 kg at 0.5 m on a massless rod, without damping.
PENDULUM = """<mujoco><compiler angle="radian"/>
<option timestep="{step}" integrator="{integrator}"><flag energy="enable"/></option><worldbody>
<body name="arm"><joint name="hinge" axis="0 1 0" damping="{damping}"/>
<inertial pos="0 0 -0.5" mass="1" diaginertia="1e-6 1e-6 1e-6"/><site name="tip" pos="0 0 -0.5"/></body></worldbody>
<actuator>{actuator}</actuator>
<sensor><jointpos name="angle" joint="hinge"/><jointvel name="speed" joint="hinge"/>{more}</sensor>{last}</mujoco>"""
MOTOR = '<motor name="drive" joint="hinge" ctrllimited="true" ctrlrange="-4 4"/>'

# A box on a floor, pushed along it.
BOX = """<mujoco><option timestep="0.002"/><worldbody>
<geom name="ground" type="plane" size="5 5 .1" solref="{solref}"/>
<body name="box" pos="0 0 0.1"><freejoint name="float"/><geom type="sphere" size=".1" mass="1" solref="{solref}"/>
<site name="push"/></body></worldbody>
<actuator><motor name="push" site="push" refsite="push" gear="1 0 0 0 0 0"/></actuator>
<sensor><framepos name="box" objtype="body" objname="box"/></sensor></mujoco>"""

# Two joints in a vertical plane, moved by motors.
ARM = """<mujoco><compiler angle="radian"/><option timestep="{step}" integrator="{integrator}"/><worldbody>
<body name="upper"><joint name="shoulder" axis="0 1 0" damping="0.3"/>
<geom type="capsule" size=".02" fromto="0 0 0 0 0 -.3" mass="0.6" contype="0" conaffinity="0"/>
<body name="lower" pos="0 0 -.3"><joint name="elbow" axis="0 1 0" damping="0.1"/>
<geom type="capsule" size=".015" fromto="0 0 0 0 0 -.25" mass="0.3" contype="0" conaffinity="0"/></body></body>
</worldbody><actuator><motor name="shoulder" joint="shoulder" gear="{gain}"/>
<motor name="elbow" joint="elbow" gear="{gain}"/></actuator>
<sensor><jointpos name="shoulder_angle" joint="shoulder"/><jointpos name="elbow_angle" joint="elbow"/></sensor>
</mujoco>"""


def pendulum(
    step: float = 0.001,
    integrator: str = "RK4",
    damping: float = 0.0,
    actuator: str = MOTOR,
    more: str = "",
    last: str = "",
) -> str:
    return PENDULUM.format(
        step=step, integrator=integrator, damping=damping, actuator=actuator, more=more, last=last
    )


def model_of(folder: Path, text: str, name: str = "robot.xml", **settings: Any) -> MjcfModel:
    """Write an MJCF and return its model."""
    file = folder / name
    file.write_text(text)
    return MjcfModel(MjcfModelConfig(file=file, **settings))


def drive(time_s: Any, first: Mapping[str, float] | None = None, run: str = "run", **inputs: Any) -> Drive:
    return Drive(History.from_arrays(inputs, np.asarray(time_s, float), run=run), dict(first or {}))


def simulated(model: MjcfModel, one: Drive, *changes: object) -> SystemReadings:
    """Return the readings of one run, with changes of the model."""
    return model.simulate(SystemParts(changes=changes), [one])[0]
