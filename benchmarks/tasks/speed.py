"""Tasks in scenes: CPU time against plain MuJoCo with the same scene and laws, and the engines' agreement.

python -m benchmarks.tasks.speed [--quick]    prints, and writes benchmarks/out/tasks_speed.json

Plain MuJoCo is the exported MJCF with its module of laws (`pliant export --part scene`), stepped at the engine's time
step in contact with the same ramp of the inputs, and nothing read but the tip. The bare scene is stepped without laws,
as passive springs: what MuJoCo itself costs.
"""

from __future__ import annotations

import importlib.util
import sys
import tempfile
import time
from pathlib import Path
from types import ModuleType
from typing import Any

import mujoco
import numpy as np
from benchmarks.grasp.gripper import finger
from benchmarks.output import Bar, component, engine, known, make_parser, write

from pliant.api import open_study
from pliant.interfaces.effect import Model
from pliant.interfaces.task import SceneTask
from pliant.pipeline.motion import prepared_chain
from pliant.pipeline.simulate import scene_engine
from pliant.records.chain import ChainModel
from pliant_plugins.envs.base import STUDIES, stored
from pliant_plugins.tasks.scene_record import SceneRecord

TASKS: dict[str, dict[str, Any]] = {
    "reach_around": {
        "arms": [{"tip": ["60 mm", "0 mm", "-70 mm"], "inputs": {"pressure_pa": "12 kPa"}}],
        "obstacles": [{"box": ["50 mm", "40 mm", "8 mm"], "position": ["42 mm", "0 mm", "-50 mm"]}],
        "radius": "7 mm",
    },
    "push": {
        "pressure": "15 kPa",
        "wall": {"position": ["25 mm", "0 mm", "0 mm"], "normal": [-1, 0, 0]},
        "radius": "7 mm",
        "levels": 1,
        "ramp_time": "2 s",
        "hold_time": "2 s",
        "distances": ["0 mm"],
    },
    "hold_and_turn": {
        "object": {"shape": "cylinder", "radius": "25 mm", "height": "50 mm", "mass": "50 g"},
        "base_radius": "60 mm",
        "inclination": "-10 deg",
        "grasp_height": "15 mm",
        "radius": "10 mm",
        "table_friction": 0.0,
        "inputs": {"pressure_1_pa": "20 kPa", "pressure_4_pa": "2 kPa"},
        "turn": {
            "keyframes": [{"time": "1 s", "inputs": [{"pressure_3_pa": "20 kPa", "pressure_4_pa": "0 kPa"}]}]
        },
    },
}
COMPARED = {
    "reach_around": ("distance_m", "press_n"),
    "push": ("holding_force_n",),
    "hold_and_turn": ("turn_rad",),
}
HARD = {"contact_stiffness": 1e6, "contact_damping": 2e3, "contact_timestep": "0.5 ms"}
ENGINES: dict[str, dict[str, Any]] = {
    "quasistatic": {},
    "mujoco": {"joint_damping": 3e-3, **HARD},
    "pybullet": {"joint_damping": 1e-3},
}
FULL = {
    "reach_around": {"pressure_pa": 12e3},
    "push": {"pressure_pa": 15e3},
    "hold_and_turn": {
        "pressure_1_pa": 20e3,
        "pressure_2_pa": 0.0,
        "pressure_3_pa": 10e3,
        "pressure_4_pa": 2e3,
    },
}
# Contacts of an object that is held, and the damping with which PyBullet's steps are not shorter than they need be.
OF_TASK: dict[str, dict[str, dict[str, Any]]] = {
    "hold_and_turn": {
        "mujoco": {"contact_stiffness": 1e5, "contact_damping": 700},
        "pybullet": {"joint_damping": 1e-4},
    }
}
RAMP_S, HOLD_S, FRAMES = 2.0, 2.0, 25
SPEED, AGREE = 0.8, 0.01


def main() -> None:
    """Compare every task with plain MuJoCo, interleaved, then the engines with each other."""
    quick = make_parser(__doc__, "fewer repeats").parse_args().quick
    bars = []
    result: dict[str, Any] = {}
    for kind, block in TASKS.items():
        task: SceneTask = component("task", kind, **block)
        chain = hand_finger() if kind == "hold_and_turn" else finger()
        cpu = _fastest(task, chain, FULL[kind], 2 if quick else 5)
        ratio = cpu["plain"] / cpu["ours"]
        print(f"{kind:<13}" + "".join(f" {name} {value:.3f} s" for name, value in cpu.items()))
        print(f"{kind:<13} speed {ratio:.2f} × plain MuJoCo, {cpu['bare'] / cpu['ours']:.2f} × without laws")
        bars.append(
            Bar(f"{kind}: speed against plain MuJoCo with the same laws", ratio, SPEED, "×", at_most=False)
        )
        measured = _measured(task, chain)
        for name in COMPARED[kind]:
            first, *others = measured
            for other in others:
                away = abs(measured[other][name] - measured[first][name]) / abs(measured[first][name])
                bars.append(Bar(f"{kind}: {name}, {other} against {first}", away, AGREE, "%", scale=100))
        result[kind] = {"cpu_s": cpu, "ratio": ratio, "metrics": measured}
    write("tasks_speed", result, bars)


def hand_finger() -> ChainModel:
    """Return the finger of `pliant/HoldAndTurn-v0`, of nine joints with two opposed chambers each."""
    opened = open_study(STUDIES / "hold_and_turn.yaml", store=stored())
    chain, _, _ = prepared_chain(opened.context, opened.study)
    return chain


def _engine(task: SceneTask, kind: str) -> Any:
    """Return an engine with the settings for a task."""
    return engine(kind, **{**ENGINES[kind], **OF_TASK.get(task.config.kind, {}).get(kind, {})})


def _fastest(task: SceneTask, chain: ChainModel, full: dict[str, float], repeats: int) -> dict[str, float]:
    """Return the least CPU seconds of the motion: in the engine, in plain MuJoCo, in MuJoCo without laws."""
    backend = _engine(task, "mujoco")
    cpu: dict[str, list[float]] = {"ours": [], "plain": [], "bare": []}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scene.xml"
        backend.export_scene(task.scene(chain), path)
        laws = _module(path.with_name("scene_law.py"))
        laws.pause()  # MuJoCo compiles no model while a Python callback is set
        for _ in range(repeats):
            record = SceneRecord(task.scene(chain))
            with backend.build_scene(record.scene) as simulation:
                begun = time.process_time()
                record.drive(simulation, [full] * len(record.scene.arms), None, RAMP_S, FRAMES)
                record.hold(simulation, HOLD_S, FRAMES)
                cpu["ours"].append(time.process_time() - begun)
            model, data = laws.load(path)
            laws.resume()
            cpu["plain"].append(_stepped(model, data, full))
            laws.pause()
            bare = mujoco.MjModel.from_xml_path(str(path))
            cpu["bare"].append(_stepped(bare, mujoco.MjData(bare), full))
    return {name: min(values) for name, values in cpu.items()}


def _module(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module
    spec.loader.exec_module(module)
    return module


def _stepped(model: mujoco.MjModel, data: mujoco.MjData, full: dict[str, float]) -> float:
    """Return CPU seconds of the ramp and the hold, reading the tip at each frame."""
    names = [model.actuator(k).name for k in range(model.nu)]
    values = np.array([next((v for one, v in full.items() if name.endswith(one)), 0.0) for name in names])
    steps = round(RAMP_S / FRAMES / model.opt.timestep)
    begun = time.process_time()
    for k in range(2 * FRAMES):
        data.ctrl[:] = values * min((k + 1) / FRAMES, 1.0)
        for _ in range(steps):
            mujoco.mj_step(model, data)
        data.body("arm_0_tip").xpos.copy()
    return time.process_time() - begun


def _measured(task: SceneTask, chain: ChainModel) -> dict[str, dict[str, float]]:
    """Return the numbers of each engine."""
    found = {}
    for kind in ENGINES:
        if known(kind) and (kind != "quasistatic" or task.settles):
            metrics = task.run(chain, scene_engine(_engine(task, kind), Model(chain))).metrics
            found[kind] = {name: v for name, v in metrics.items() if isinstance(v, float)}
            print(f"  {kind:<12}" + ", ".join(f"{name} {value:.5g}" for name, value in found[kind].items()))
    return found


if __name__ == "__main__":
    main()
