"""The same systems and recordings for MuJoCo's own identification (`mujoco.sysid`) and for Pliant.

    python -m benchmarks.systems.beside_sysid --systems reacher pusher --kinds viscous_damping supply_lag --store

Two runs are held out. Numbers of the model alone are fitted to the others: by `mujoco.sysid` the damping, friction loss
and armature of every joint, the masses and the gains of the actuators; by `pliant extend` the same without armature,
which no effect of Pliant changes. Then `pliant improve` sees what it finds missing. Printed is the error on the
held-out runs in σ: 1 is the noise. `mujoco.sysid` needs the packages of `pip install 'mujoco[sysid]'`.
"""

from __future__ import annotations

import contextlib
import io
import json
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from benchmarks.evidence.truths import CLEAN
from benchmarks.output import OUT, make_parser
from benchmarks.systems.form_table import EVERY
from benchmarks.systems.protocol import Run, protocol
from benchmarks.systems.publish import BESIDE
from benchmarks.systems.robots import ROBOTS, Robot, mjcf, present
from benchmarks.systems.sets import SystemSet, SystemSpec, make_set
from benchmarks.systems.shapes import Array
from benchmarks.systems.tasks import kinds_of
from mujoco import sysid

from pliant import api
from pliant.store.store import write_atomically

HELD_OUT = ("steps", "in_turn")
KINDS = (
    "viscous_damping",
    "coulomb_friction",
    "actuation_gain",
    "supply_lag",
    "sensor_lag",
    "friction_hysteresis",
)
NUMBERS = {
    "viscous_damping": "joint",
    "coulomb_friction": "joint",
    "body_mass": "body",
    "actuation_gain": "input",
}
MOST_ITERATIONS = 30
LEAST = 0.3  # of stated inertias, masses and gains, for sysid


def main(arguments: Sequence[str] | None = None) -> None:
    """Run both tools on a set of every kind and system."""
    parser = make_parser(__doc__)
    parser.add_argument("--systems", nargs="+", choices=tuple(ROBOTS), default=("reacher",), metavar="SYSTEM")
    parser.add_argument(
        "--kinds", nargs="+", choices=(CLEAN, *EVERY), default=(CLEAN, *KINDS), metavar="KIND"
    )
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--draw", default="beside sysid", help="other sets for another word")
    parser.add_argument("--store", action="store_true", help="put the rows into the table of the page")
    parser.add_argument("--no-improve", action="store_true", help="only the fits of numbers")
    given = parser.parse_args(arguments)
    if not hasattr(sysid, "optimize"):
        raise SystemExit("mujoco.sysid lacks its packages: pip install 'mujoco[sysid]'")
    rows: list[dict[str, Any]] = []
    OUT.mkdir(parents=True, exist_ok=True)
    print(
        "error on held-out runs, σ     as it is   sysid  pliant's numbers  improve   min of sysid, numbers, improve"
    )
    for robot in present(tuple(given.systems)):
        for kind in [one for one in given.kinds if one == CLEAN or one in kinds_of(robot.name, tuple(EVERY))]:
            row = compared(
                SystemSpec(kind, given.seed, robot.name, "judged", given.draw), not given.no_improve
            )
            rows.append(row)
            errors = "  ".join(
                f"{row['error'].get(n, np.nan):8.3f}" for n in ("stated", "sysid", "extend", "improve")
            )
            spent = "  ".join(f"{v / 60:.1f}" for v in row["seconds"].values())
            print(f"{robot.name:14s}{row['hidden']:24s}{errors}   {spent}  {row['found']}", flush=True)
            write_atomically(OUT / "beside_sysid.json", json.dumps(rows, indent=1))
            if given.store:
                _stored(row)


def _stored(row: dict[str, Any]) -> None:
    """Put a row into the file of the page, in place of an earlier one of the same set."""
    before = json.loads(BESIDE.read_text()) if BESIDE.exists() else []
    others = [one for one in before if (one["robot"], one["hidden"]) != (row["robot"], row["hidden"])]
    write_atomically(BESIDE, json.dumps([*others, row], indent=1) + "\n")


def compared(spec: SystemSpec, improve: bool) -> dict[str, Any]:
    """Return errors and seconds of both tools on one set."""
    robot, made = ROBOTS[spec.robot], make_set(spec, "beside")
    runs = protocol(robot, spec.generator())
    with tempfile.TemporaryDirectory() as folder:
        return _compared(robot, runs, made, Path(folder), improve)


def _compared(
    robot: Robot, runs: tuple[Run, ...], made: SystemSet, folder: Path, improve: bool
) -> dict[str, Any]:
    (folder / "beside.xml").write_text(made.model)
    (folder / "study.yaml").write_text(made.study)
    head, *lines = made.csv.splitlines()
    for name, wanted in (("train.csv", False), ("held.csv", True)):
        chosen = [line for line in lines if (line.partition(",")[0] in HELD_OUT) == wanted]
        (folder / name).write_text("\n".join([head, *chosen]) + "\n")
    table = _table(robot, runs, made.csv)
    opened = api.open_study(folder / "study.yaml", store=folder / "store")
    held = api.predictor(opened, folder / "held.csv")
    sigma = made.label["sigma"]

    def of_pliant(effects: Any) -> float:
        found = held.predict(effects)
        left = [
            (run.outputs[n] - read[n]) / sigma[n]
            for run, read in zip(held.measurement.runs, found, strict=True)
            for n in sigma
        ]
        return float(np.sqrt(np.mean(np.concatenate(left) ** 2)))

    errors, seconds = {"stated": of_pliant(())}, {}
    errors["sysid"], seconds["sysid"] = _timed(lambda: _by_sysid(robot, runs, table, sigma))
    effects, seconds["extend"] = _timed(lambda: _numbers(opened, folder / "train.csv", robot))
    errors["extend"], found = of_pliant(effects), ""
    if improve:
        steps, seconds["improve"] = _timed(lambda: api.improve(opened, folder / "train.csv").steps)
        errors["improve"], found = of_pliant(steps[-1].effects), " + ".join(e.kind for e in steps[-1].effects)
    return {
        "robot": robot.name,
        "hidden": made.label["kind"],
        "error": errors,
        "seconds": seconds,
        "found": found,
    }


def _timed(work: Callable[[], Any]) -> tuple[Any, float]:
    begun = time.perf_counter()
    return work(), time.perf_counter() - begun


def _numbers(opened: api.OpenStudy, data: Path, robot: Robot) -> Any:
    """Return the effects that `pliant extend` fits: the numbers that sysid fits, each at its own place."""
    model = api.predictor(opened, data)
    kinds = [
        one for kind, place in NUMBERS.items() for one in _at_places(kind, model.attachments.get(place, ()))
    ]
    return api.extend(
        opened, [one for one in kinds if one.partition("@")[0] not in robot.without], data
    ).effects


def _at_places(kind: str, names: Sequence[str]) -> list[str]:
    return [f"{kind}@{name}" for name in names] if len(names) > 1 else [kind] * len(names)


def _table(robot: Robot, runs: tuple[Run, ...], csv: str) -> dict[str, dict[str, Array]]:
    """Return the columns of every run."""
    head, *lines = (line.split(",") for line in csv.splitlines())
    return {
        run.name: dict(
            zip(
                head[1:],
                np.array([[float(v) for v in row[1:]] for row in lines if row[0] == run.name]).T,
                strict=True,
            )
        )
        for run in runs
    }


def _by_sysid(
    robot: Robot, runs: tuple[Run, ...], table: Mapping[str, Mapping[str, Array]], sigma: Mapping[str, float]
) -> float:
    """Return the error on held-out runs after `mujoco.sysid.optimize` of the numbers."""
    spec = mujoco.MjSpec.from_string(mjcf(robot.name))
    model = spec.compile()
    start = _start(robot, model, runs[0])
    sensors = [*robot.joints, *(stem for stem, (_, axes) in robot.sites.items() if len(axes) == 3)]
    trained = [run for run in runs if run.name not in HELD_OUT]
    sequences = []
    for run in trained:
        columns = [c for s in sensors for c in ((s,) if s in robot.joints else [f"{s}_{a}_m" for a in "xyz"])]
        data = np.column_stack([table[run.name][c] for c in columns])
        read = sysid.TimeSeries.from_names(run.time_s, data, model, names=sensors)
        control = sysid.TimeSeries(run.time_s, _controls(robot, model, run))
        sequences.append(
            sysid.ModelSequences(robot.name, spec, run.name, start, control, read, allow_missing_sensors=True)
        )
    parameters = _parameters(robot, model)
    residual = sysid.build_residual_fn(models_sequences=sequences, n_threads=1)
    parameters.move_off_bounds()
    with contextlib.redirect_stdout(io.StringIO()):
        fitted, _ = sysid.optimize(parameters, residual, verbose=False, max_iters=MOST_ITERATIONS)
    best = sysid.apply_param_modifiers(fitted, spec)
    left = []
    for run in (one for one in runs if one.name in HELD_OUT):
        predicted = _predicted(robot, best, run, start)
        left += [(predicted[name] - table[run.name][name]) / sigma[name] for name in robot.columns]
    return float(np.sqrt(np.mean(np.concatenate(left) ** 2)))


def _parameters(robot: Robot, model: Any) -> Any:
    """Return what is fitted: damping, friction loss and armature of joints, masses, gains of actuators."""
    found = sysid.ParameterDict()

    def add(name: str, value: float, low: float, high: float, change: Callable[[Any, float], None]) -> None:
        def modifier(spec: Any, parameter: Any) -> None:
            change(spec, float(parameter.value[0]))

        found.add(sysid.Parameter(name, value, low, high, modifier=modifier))

    for k in range(model.njnt):
        name, dof = model.joint(k).name, int(model.jnt_dofadr[k])
        size = float(1.0 / model.dof_invweight0[dof])
        for what, values in (
            ("damping", model.dof_damping),
            ("frictionloss", model.dof_frictionloss),
            ("armature", model.dof_armature),
        ):
            value = float(values[dof])
            low = LEAST * value if what == "armature" else 0.0  # less inertia makes the steps unstable
            add(f"{what} {name}", value, low, 5.0 * (value + size), partial(_set_joint, name, what))
    for k in range(1, model.nbody) if "body_mass" not in robot.without else ():
        name, mass = model.body(k).name, float(model.body_mass[k])
        if mass > 0.0:
            add(f"mass {name}", mass, LEAST * mass, 5.0 * mass, partial(_set_mass, name))
    for actuator, _, _ in robot.inputs.values():
        stated = float(model.actuator_gainprm[model.actuator(actuator).id, 0])
        add(f"gain {actuator}", 1.0, LEAST, 3.0, partial(_scale_gain, actuator, stated))
    return found


def _set_joint(name: str, what: str, spec: Any, value: float) -> None:
    """Set a number of a joint; of a polynomial the linear coefficient."""
    joint = spec.joint(name)
    now = np.atleast_1d(np.array(getattr(joint, what), float))
    now[0] = value
    setattr(joint, what, now if np.ndim(getattr(joint, what)) else value)


def _set_mass(name: str, spec: Any, value: float) -> None:
    spec.body(name).mass = value


def _scale_gain(name: str, stated: float, spec: Any, factor: float) -> None:
    actuator = spec.actuator(name)
    gains = np.array(actuator.gainprm)
    gains[0] = factor * stated
    actuator.gainprm = gains


def _start(robot: Robot, model: Any, run: Run) -> Array:
    """Return the state at the start of every run: the stated one, or at rest under the first inputs."""
    data = mujoco.MjData(model)
    for joint, position in robot.start.items():
        data.joint(joint).qpos = position
    data.ctrl[:] = _controls(robot, model, run)[0]
    for _ in range(round(5.0 * robot.settle_s / model.opt.timestep)):
        mujoco.mj_step(model, data)
    return np.asarray(sysid.create_initial_state(model, data.qpos, 0.0 * data.qvel, data.act))


def _controls(robot: Robot, model: Any, run: Run) -> Array:
    found = np.zeros((len(run.time_s), model.nu))
    for values, (actuator, _, _) in zip(run.commands.T, robot.inputs.values(), strict=True):
        found[:, model.actuator(actuator).id] = values
    return found


def _predicted(robot: Robot, model: Any, run: Run, start: Array) -> dict[str, Array]:
    """Return the readings of a run from the model's own steps."""
    clock = float(model.opt.timestep) * np.arange(round(run.time_s[-1] / model.opt.timestep) + 2)
    commanded = _controls(robot, model, run)
    controls = np.stack([np.interp(clock, run.time_s, u) for u in commanded.T], axis=1)
    sensors = mujoco.rollout.rollout(model, mujoco.MjData(model), start, controls)[1][0]
    found = {}
    for column, sensor in robot.columns.items():
        name, _, axis = sensor.partition(".")
        k = int(model.sensor(name).adr[0]) + ("xyz".index(axis) if axis else 0)
        found[column] = np.interp(run.time_s, clock, sensors[:, k])
    return found


if __name__ == "__main__":
    main()
