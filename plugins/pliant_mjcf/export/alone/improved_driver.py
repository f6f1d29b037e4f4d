"""{about}

    model, data = load()                    # the MJCF in this file's folder
    robot = Robot(model, data)              # with what MJCF cannot say
    robot.step(ctrl)                        # instead of mujoco.mj_step(model, data), with data.ctrl = ctrl
    ctrl = controls(time_s, commanded)      # (t, nu) from the columns of a recording, name -> (t,)
    seen = readings(time_s, raw)            # what the sensors report, from true readings by column

It needs numpy and mujoco. `replay` simulates a recorded run; `python {file} --check` replays the check file next to it.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np

# Filled in by the export: the file; column -> actuator and curve; fixed actuators; column -> sensor and component.
MJCF = "robot.xml"
INPUTS: dict[str, tuple[str, list[tuple[float, float]]]] = {}
FIXED: dict[str, float] = {}
OUTPUTS: dict[str, tuple[str, int]] = {}

# --- what effects need ---


class UserError(ValueError):
    """An effect that does not fit the model."""


class ImpossibleEffectError(UserError):
    """An effect that the model cannot have."""


class Effect:
    """An effect with its numbers."""

    def __init__(self, **config: Any) -> None:
        self.config = SimpleNamespace(**config)


class Run:
    """The inputs of a run: `time_s` (t,), and `actuation`, (t,) by column."""

    def __init__(self, time_s: Any, actuation: Any) -> None:
        self.time_s, self.actuation = time_s, dict(actuation)

    def with_actuation(self, **changes: Any) -> Run:
        """Return the run with some inputs replaced."""
        return Run(self.time_s, {**self.actuation, **changes})


# Effects that MJCF cannot say
INPUT_MAPS: list[Any] = []
OUTPUT_MAPS: list[Any] = []
MODEL_CHANGES: list[Any] = []
FORCES: list[Any] = []
DRIVES: list[Any] = []

# --- the driver ---
STATE = mujoco.mjtState.mjSTATE_INTEGRATION
ROUNDING = 1e-6  # of a step: samples that near to one are at it


def load(path: str | Path | None = None) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Return model and data of the MJCF, by default of the one in this file's folder."""
    model = mujoco.MjModel.from_xml_path(str(path or Path(__file__).with_name(MJCF)))
    for one in MODEL_CHANGES:
        one.change(model)
    if MODEL_CHANGES:
        mujoco.mj_setConst(model, mujoco.MjData(model))
    return model, mujoco.MjData(model)


class Robot:
    """The model with the forces and drives that MJCF cannot say; they may remember, so a motion has its own robot."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        self.model, self.data = model, data
        self.reset()

    def reset(self) -> None:
        """Forget the motion so far: what remembers begins at the present positions."""
        q, v = self.data.qpos[None].copy(), self.data.qvel[None].copy()
        self._drives = [one.start(self.model) for one in DRIVES]
        self._forces = [one.start(self.model, q, v) for one in FORCES]

    def step(self, ctrl: Any = None) -> None:
        """Step once, as `mujoco.mj_step`; `ctrl` is (nu,) that of the model, by default `data.ctrl`."""
        model, data, step_s = self.model, self.data, float(self.model.opt.timestep)
        asked = np.array(data.ctrl if ctrl is None else ctrl, float)[None]
        q, v = data.qpos[None].copy(), data.qvel[None].copy()
        for k, one in enumerate(DRIVES):
            asked, self._drives[k] = one.advance(model, self._drives[k], q, v, asked, step_s)
        data.ctrl[:] = asked[0]
        if FORCES:
            outer = data.qfrc_applied.copy()
            for k, one in enumerate(FORCES):
                force, self._forces[k] = one.advance(model, self._forces[k], q, v, step_s)
                data.qfrc_applied += force[0]
            mujoco.mj_step(model, data)
            data.qfrc_applied[:] = outer
        else:
            mujoco.mj_step(model, data)


def controls(time_s: Any, commanded: Any, model: mujoco.MjModel | None = None) -> np.ndarray:
    """Return (t, nu) ctrl for commands by column, (t,) each: effects of the inputs, then the columns' curves."""
    model = load()[0] if model is None else model
    run = Run(np.asarray(time_s, float), {name: np.asarray(v, float) for name, v in commanded.items()})
    for change in INPUT_MAPS:
        run = change(run)
    found = np.zeros((len(run.time_s), model.nu))
    for name, value in FIXED.items():
        found[:, model.actuator(name).id] = value
    for column, (name, curve) in INPUTS.items():
        values = run.actuation[column]
        if curve:
            x, y = np.array(curve).T
            k = np.clip(np.searchsorted(x, values, side="right") - 1, 0, len(x) - 2)
            values = y[k] + (values - x[k]) * (y[k + 1] - y[k]) / (x[k + 1] - x[k])
        found[:, model.actuator(name).id] = values
    return found


def readings(time_s: Any, raw: Any) -> dict[str, np.ndarray]:
    """Return what the sensors report, (t,) by column, from true readings by column."""
    found = {"time_s": np.asarray(time_s, float), **raw}
    for change in OUTPUT_MAPS:
        found = change(found)
    return {name: values for name, values in found.items() if name != "time_s"}


def replay(time_s: Any, commanded: Any, state: Any, path: str | Path | None = None) -> dict[str, np.ndarray]:
    """Return the readings of a run by column, (t,) each, from commands by column and MuJoCo's state at its start."""
    model, data = load(path)
    clock = np.asarray(time_s, float) - time_s[0]
    ctrl = controls(time_s, commanded, model)
    mujoco.mj_setState(model, data, np.array(state, float), STATE)
    robot, step_s = Robot(model, data), float(model.opt.timestep)
    places = clock / step_s
    places = np.where(np.abs(places - np.round(places)) < ROUNDING, np.round(places), places)
    before = np.floor(places).astype(int)
    share = places - before
    records = np.zeros((int(np.max(before + (share > 0.0))) + 1, model.nsensordata))
    for k in range(len(records)):
        robot.step([np.interp(k * step_s, clock, column) for column in ctrl.T])
        records[k] = data.sensordata  # at the beginning of the step
    after = np.minimum(before + 1, len(records) - 1)
    table = (1.0 - share)[:, None] * records[before] + share[:, None] * records[after]
    columns = {name: model.sensor(sensor).adr[0] + part for name, (sensor, part) in OUTPUTS.items()}
    return readings(time_s, {name: table[:, place] for name, place in columns.items()})


def check(path: str | Path | None = None) -> list[str]:
    """Return sentences on readings that differ from the study's predictions, by the check file in this folder."""
    file = Path(path) if path else Path(__file__).with_name(f"{Path(__file__).stem}.check.json")
    said = json.loads(file.read_text(encoding="utf-8"))
    found = []
    for run in said["runs"]:
        seen = replay(run["time_s"], run["commanded"], run["state"])
        for name, wanted in run["readings"].items():
            off = float(np.max(np.abs(seen[name] - np.array(wanted))))
            if not off <= said["tolerance"][name]:
                found.append(f"{run['run']}: {name} differs by {off:.3g}")
    return found


if __name__ == "__main__":
    if "--check" not in sys.argv:
        sys.exit(__doc__)
    differences = check()
    print("\n".join(differences) or "It does what the study predicts.")
    sys.exit(1 if differences else 0)
