"""The simulation of a truth: another integrator at a quarter of the file's step, with the hidden effect in it.

The model's numbers are off by about 0.4 % from the file that the diagnoser gets. Signals pass their equations at the
fine steps; forces act in a loop of their own over all runs; the rest are changes of numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import mujoco
import numpy as np
from benchmarks.systems.force_equations import Force, Sizes
from benchmarks.systems.form_table import EVERY, Form
from benchmarks.systems.protocol import Run
from benchmarks.systems.robots import Robot, mjcf
from benchmarks.systems.shapes import TINY, Array
from benchmarks.systems.simulation import drive_gains, is_tendon, push, seen
from mujoco.rollout import rollout

from pliant_plugins.physics.mujoco.warned import silent

FINER = 4
NUMBERS_OFF = 0.004
PHYSICS = mujoco.mjtState.mjSTATE_FULLPHYSICS
FORCES = ("joint", "joints", "spring", "drive", "tendon", "pulled")
LEAST = 0.03  # of the largest size of a kind, for places that hardly move


class FailedTruthError(RuntimeError):
    """The truth cannot be simulated, or its effect does not show."""


@dataclass(frozen=True, eq=False)
class Hidden:
    """An effect without its strength: its kind, form and drawn numbers, and the names of its places."""

    kind: str
    form: Form
    places: tuple[str, ...]
    numbers: Mapping[str, float]
    sign: float = 1.0

    @property
    def place(self) -> str:
        """Return the kind of its places."""
        return EVERY[self.kind].place


@dataclass(eq=False)
class Moves:
    """Clean motion at the fine steps: (runs, steps, …) positions, speeds and drives by `joint` and `tendon`."""

    q: dict[str, Array] = field(default_factory=dict)
    v: dict[str, Array] = field(default_factory=dict)
    drive: dict[str, Array] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Truth:
    """A system with numbers that are a little off, its runs, and what may be hidden in it."""

    robot: Robot
    runs: tuple[Run, ...]
    seed: int
    hidden: Hidden | None = None

    def with_hidden(self, hidden: Hidden | None) -> Truth:
        """Return the same system with another effect; what the clean motion says of its sizes is kept."""
        other = replace(self, hidden=hidden)
        other.__dict__["moves"] = self.moves
        return other

    def model(self) -> Any:
        """Return the compiled model with its own numbers, integrator and step."""
        spec = mujoco.MjSpec.from_string(mjcf(self.robot.name))
        for body in spec.bodies[1:]:
            body.gravcomp = TINY  # MuJoCo looks at it only where the compiler has seen one
        model = spec.compile()
        rng = np.random.default_rng(self.seed)
        for values in (model.body_mass, model.dof_damping, model.jnt_stiffness, model.body_pos):
            values *= 1.0 + NUMBERS_OFF * rng.standard_normal((len(values),) + (1,) * (values.ndim - 1))
        model.body_inertia *= (1.0 + NUMBERS_OFF * rng.standard_normal(model.nbody))[:, None]
        model.opt.timestep /= FINER
        model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{self.robot.integrator.upper()}")
        return model

    @cached_property
    def clock(self) -> Array:
        """Return (k,) the fine steps' times; before zero the system comes to rest."""
        step = float(mujoco.MjModel.from_xml_string(mjcf(self.robot.name)).opt.timestep) / FINER
        return np.asarray(
            step * np.arange(-round(self.robot.settle_s / step), round(self.robot.duration_s / step) + 2)
        )

    def start(self, model: Any) -> Array:
        """Return the state before the first step."""
        data = mujoco.MjData(model)
        for joint, position in self.robot.start.items():
            data.joint(joint).qpos = position
        mujoco.mj_forward(model, data)
        state = np.empty(mujoco.mj_stateSize(model, PHYSICS))
        mujoco.mj_getState(model, data, state, PHYSICS)
        return state

    def names(self, place: str) -> tuple[str, ...]:
        """Return the places of a kind."""
        model = self.model()
        drives = [k for k in range(model.nu) if model.actuator_biasprm[k, 1] < 0.0]
        joints = [model.joint(k) for k in range(model.njnt)]
        tendons = [model.tendon(k).name for k in range(model.ntendon)]
        pulled = {int(model.actuator_trnid[k, 0]) for k in drives if is_tendon(model, k)}
        driven = {int(model.actuator_trnid[k, 0]) for k in drives if not is_tendon(model, k)}
        found: dict[str, Sequence[str]] = {
            "input": tuple(self.robot.inputs),
            "all_inputs": ("all",) if len(self.robot.inputs) > 1 else (),
            "output": tuple(self.robot.columns),
            "vector": tuple(stem for stem, (_, axes) in self.robot.sites.items() if len(axes) == 3),
            "joint": [one.name for one in joints],
            "joints": ("all",) if model.njnt > 1 else (),
            "spring": [one.name for one in joints if model.jnt_stiffness[one.id] > 0.0],
            "drive": [one.name for one in joints if one.id in driven],
            "tendon": tendons,
            "pulled": [name for k, name in enumerate(tendons) if k in pulled],
            "body": [model.body(k).name for k in range(1, model.nbody) if model.body_mass[k] > 0.0],
            "world": ("world",),
        }
        return tuple(found[place])

    @cached_property
    def moves(self) -> Moves:
        """Return the clean motion."""
        return self._loop(self.model(), None, None)[1]

    def readings(self, strength: float = 0.0) -> list[dict[str, Array]]:
        """Return the noiseless readings of every run with the effect at a strength.

        Raises:
            FailedTruthError: the simulation diverges.
        """
        with silent():
            return self._readings(strength)

    def _readings(self, strength: float) -> list[dict[str, Array]]:
        hidden, model, change = self.hidden, self.model(), None
        s = strength * (hidden.sign if hidden else 1.0)
        if hidden and hidden.place in ("body", "world"):
            bodies = [model.body(name).id for name in hidden.places] if hidden.place == "body" else [0]
            for body in bodies:
                change = hidden.form.equation(model, body, s, hidden.numbers, hidden.form.shape)
        mujoco.mj_setConst(model, mujoco.MjData(model))
        model.body_gravcomp[model.body_gravcomp == TINY] = 0.0
        if (hidden and hidden.place in FORCES) or change:
            sensors, _ = self._loop(model, self._force(model, s), change)
        else:
            start = np.tile(self.start(model), (len(self.runs), 1))
            sensors = rollout(model, mujoco.MjData(model), start, self._controls(s))[1]
        if not np.isfinite(sensors).all() or np.abs(sensors).max() > 1e4:
            raise FailedTruthError("the truth diverges")
        return self._sampled(model, sensors, s)

    def _controls(self, s: float) -> Array:
        """Return (runs, k, inputs) controls at the fine steps, after a hidden effect of the inputs."""
        names, clock = list(self.robot.inputs), self.clock
        found = np.stack(
            [np.stack([np.interp(clock, r.time_s, u) for u in r.commands.T], axis=1) for r in self.runs]
        )
        hidden = self.hidden
        if hidden and hidden.place in ("input", "all_inputs"):
            chosen = [k for k, name in enumerate(names) if name in hidden.places or "all" in hidden.places]
            top = np.abs(found).max(axis=(0, 1))[chosen]
            for run in found:
                run[:, chosen] = self._passed(run[:, chosen], top, s)
        model = mujoco.MjModel.from_xml_string(mjcf(self.robot.name))
        order = [model.actuator(one[0]).id for one in self.robot.inputs.values()]
        placed = np.zeros((*found.shape[:2], model.nu))
        placed[..., order] = found
        return placed

    def _passed(self, values: Array, top: Array, s: float) -> Array:
        assert self.hidden is not None
        form = self.hidden.form
        return np.asarray(form.equation(values, self.clock, top, s, self.hidden.numbers, form.shape))

    def _sampled(self, model: Any, sensors: Array, s: float) -> list[dict[str, Array]]:
        """Return the readings at the samples of each run, after a hidden effect of the outputs."""
        names = [name for k in range(model.nsensor) for name in self._columns(model, k)]
        hidden = self.hidden
        if hidden and hidden.place in ("output", "vector"):
            own = (
                hidden.places
                if hidden.place == "output"
                else [f"{p}_{c}_m" for p in hidden.places for c in "xyz"]
            )
            chosen = [names.index(name) for name in own]
            top = np.abs(sensors[:, self.clock >= 0.0]).max(axis=(0, 1))[chosen]
            for run in sensors:
                run[:, chosen] = self._passed(run[:, chosen], top, s)
        return [
            {one: np.interp(r.time_s, self.clock, table[:, names.index(one)]) for one in self.robot.columns}
            for r, table in zip(self.runs, sensors, strict=True)
        ]  # fmt: skip

    def _columns(self, model: Any, sensor: int) -> list[str]:
        name = model.sensor(sensor).name
        return [name] if model.sensor_dim[sensor] == 1 else [f"{name}_{c}_m" for c in "xyz"]

    def sizes(self, model: Any, what: str, chosen: Sequence[int]) -> Sizes:
        """Return sizes of places; of several the median, so that a number is the same at all."""
        q, v, drive = (getattr(self.moves, name)[what] for name in ("q", "v", "drive"))
        moving = self.clock >= 0.0
        span, middle = 0.5 * np.ptp(q[:, moving], axis=(0, 1)), q[:, moving].mean(axis=(0, 1))
        speed, force = v[:, moving].std(axis=(0, 1)), drive[:, moving].std(axis=(0, 1))
        typical = [np.maximum(one, LEAST * one.max())[chosen] for one in (force, span, speed)]
        size_f, size_q, size_v = (np.full(len(chosen), np.median(one)) for one in typical)
        if what == "tendon":
            rest = model.tendon_lengthspring[chosen, 0]
            return Sizes(size_f, size_q, size_v, middle[chosen], rest, drive_gains(model, chosen, True))
        address = model.jnt_qposadr[chosen]
        own = model.jnt_stiffness[chosen]
        gain = own if self.hidden and self.hidden.place == "spring" else drive_gains(model, chosen, False)
        return Sizes(size_f, size_q, size_v, middle[chosen], model.qpos_spring[address], gain)

    def _force(self, model: Any, s: float) -> tuple[str, list[int], Force] | None:
        """Return whether the hidden force acts at joints or tendons, at which, and its equation, started anew."""
        hidden = self.hidden
        if not hidden or hidden.place not in FORCES:
            return None
        what = "tendon" if hidden.place in ("tendon", "pulled") else "joint"
        every = hidden.place == "joints"
        chosen = list(range(model.njnt)) if every else [getattr(model, what)(n).id for n in hidden.places]
        sizes = self.sizes(model, what, chosen)
        return what, chosen, hidden.form.equation(sizes, s, hidden.numbers, hidden.form.shape)

    def _loop(
        self, model: Any, force: tuple[str, list[int], Force] | None, change: Callable[[float], None] | None
    ) -> tuple[Array, Moves]:
        """Return (runs, k, …) sensors step by step, and without a force the motion of joints and tendons."""
        data = [mujoco.MjData(model) for _ in self.runs]
        for one in data:
            mujoco.mj_setState(model, one, self.start(model), PHYSICS)
            mujoco.mj_forward(model, one)
        strength = 0.0 if self.hidden is None or force else None
        controls = self._controls(strength or 0.0)
        sensors = np.empty((*controls.shape[:2], model.nsensordata))
        kept: dict[str, list[Any]] = {f"{what} {name}": [] for what in ("joint", "tendon") for name in "qva"}
        bare = model.dof_damping.copy()
        for k, time_s in enumerate(self.clock):
            if change:
                change(float(time_s))
            damping = [None] * len(data)
            if force:
                damping = push(model, data, force, controls[:, k], float(time_s))
            for r, one in enumerate(data):
                if damping[r] is not None:
                    model.dof_damping[:] = bare + damping[r]
                one.ctrl[:] = controls[r, k]
                mujoco.mj_step(model, one)
                if one.warning.number.any():
                    raise FailedTruthError("the truth diverges")
                sensors[r, k] = one.sensordata
            model.dof_damping[:] = bare
            if not force and not change:
                for what in ("joint", "tendon"):
                    for name, values in zip("qva", seen(model, data, what), strict=True):
                        kept[f"{what} {name}"].append(values)
        stacked = {key: np.stack(some, axis=1) for key, some in kept.items() if some}
        parts = [{w: stacked[f"{w} {n}"] for w in ("joint", "tendon") if stacked} for n in "qva"]
        return sensors, Moves(*parts)
