"""Tasks in scenes: CPU time against plain MuJoCo with the same scene and laws, and the engines' agreement.

python -m benchmarks.tasks.speed [--quick]    prints, and writes benchmarks/out/tasks_speed.json

Plain MuJoCo is the exported MJCF with its module of laws (`pliant export --part scene`), stepped at the engine's time
step in contact with the same inputs, and nothing read but the tip. The bare scene is stepped without laws, as passive
springs: what MuJoCo itself costs. Engines of `crawl` are compared at hard contacts and short steps; MuJoCo with the
settings of examples/crawl is shown beside them.
"""

from __future__ import annotations

import importlib.util
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

import mujoco
from benchmarks.grasp.gripper import finger
from benchmarks.output import ROOT, Bar, component, engine, known, make_parser, registry, workbench, write

from pliant.api import open_study
from pliant.config.loading import load_study
from pliant.interfaces.effect import Model
from pliant.interfaces.task import SceneTask
from pliant.pipeline.motion import prepared_chain
from pliant.pipeline.simulate import scene_engine
from pliant.pipeline.study import build_study_chain
from pliant.records.chain import ChainModel
from pliant.records.rollout import Inputs
from pliant_plugins.envs.base import STUDIES, stored
from pliant_plugins.tasks.crawl.task import Crawl
from pliant_plugins.tasks.scene_record import SceneRecord

# Inputs and the time for which they act.
Frame = tuple[dict[str, float], float]

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
        "distances": ["0 mm", "1 mm"],
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
    "push": ("holding_force_n", "stiffness_n_per_m"),
    "hold_and_turn": ("turn_rad",),
}
# The same on a table with friction, by fingers that do not slide on the object: where they slide, engines differ.
ROUGH = {"hold_and_turn": {"table_friction": 0.1, "friction": 2.0}}
HARD = {"contact_stiffness": 1e6, "contact_damping": 2e3, "contact_timestep": "0.5 ms"}
ENGINES: dict[str, dict[str, Any]] = {
    "quasistatic": {},
    "mujoco": {"joint_damping": 3e-3, **HARD},
    "pybullet": {"joint_damping": 1e-3, "contact_memory": 1e-5},
}
# Contacts of an object that is held, and the damping with which PyBullet's steps are not shorter than they need be.
HANDS: dict[str, dict[str, Any]] = {
    "mujoco": {**ENGINES["mujoco"], "contact_stiffness": 1e5, "contact_damping": 700},
    "pybullet": {"joint_damping": 1e-4},
}
CRAWLER = ROOT / "examples" / "crawl" / "crawler.yaml"
DAMPED = {"joint_damping": 1e-3}
CRAWLERS: dict[str, dict[str, Any]] = {
    "mujoco": {**DAMPED, **HARD, "slip_damping": 3e3, "contact_timestep": "0.1 ms"},
    "pybullet": {**DAMPED, "friction_anchors": False},
    "mujoco, example": {**DAMPED, **HARD, "slip_damping": 1e3},
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
RAMP_S, FRAMES = 2.0, 25
SPEED, AGREE = 0.8, 0.01


def main() -> None:
    """Compare every task with plain MuJoCo, interleaved, then the engines with each other."""
    quick = make_parser(__doc__, "fewer repeats").parse_args().quick
    bars: list[Bar] = []
    result: dict[str, Any] = {}
    for kind, block in TASKS.items():
        task: SceneTask = component("task", kind, **block)
        holds = kind == "hold_and_turn"
        chain, engines = (hand_finger(), HANDS) if holds else (finger(), ENGINES)
        cpu, bar = _speed(kind, task, chain, _ramp(FULL[kind]), 2 if quick else 5, engines["mujoco"])
        bars.append(bar)
        measured = _measured(task, chain, engines)
        bars += _agreement(kind, COMPARED[kind], measured)
        result[kind] = {"cpu_s": cpu, "ratio": bar.reached, "metrics": measured}
        if kind in ROUGH:
            rough = _measured(component("task", kind, **{**block, **ROUGH[kind]}), chain, engines)
            bars += _agreement(f"{kind}, friction", COMPARED[kind], rough)
            result[f"{kind}_friction"] = rough
    result["crawl"] = _crawl(bars, 2 if quick else 5)
    write("tasks_speed", result, bars)


def _agreement(what: str, names: Sequence[str], measured: Mapping[str, Mapping[str, float]]) -> list[Bar]:
    """Return the bars of the other engines' metrics against the first one's."""
    first, *others = measured
    bars = []
    for name in names:
        for other in others:
            away = abs(measured[other][name] - measured[first][name]) / abs(measured[first][name])
            bars.append(Bar(f"{what}: {name}, {other} against {first}", away, AGREE, "%", scale=100))
    return bars


def hand_finger() -> ChainModel:
    """Return the finger of `pliant/HoldAndTurn-v0`, of nine joints with two opposed chambers each."""
    opened = open_study(STUDIES / "hold_and_turn.yaml", store=stored())
    chain, _, _ = prepared_chain(opened.context, opened.study)
    return chain


def _crawl(bars: list[Bar], repeats: int) -> dict[str, Any]:
    """Compare the hand-made crawler of the examples; add its bars."""
    study = load_study(CRAWLER, registry())
    chain = build_study_chain(workbench(), study).chain
    assert study.task is not None
    task = Crawl(study.task)
    config = task.config
    one = [
        (dict(task.commands(chain, (k + 0.5) / config.commands)[0]), config.period_s / config.commands)
        for k in range(config.commands)
    ]
    cpu, bar = _speed("crawl", task, chain, 2 * one, repeats, CRAWLERS["mujoco, example"])
    bars.append(bar)
    measured = _measured(task, chain, CRAWLERS)
    for name in ("speed_m_s", "work_j"):
        if "pybullet" in measured:
            ours, other = measured["mujoco"][name], measured["pybullet"][name]
            away = abs(other - ours) / abs(ours)
            bars.append(Bar(f"crawl: {name}, pybullet against mujoco", away, AGREE, "%", scale=100))
    return {"cpu_s": cpu, "ratio": bar.reached, "metrics": measured}


def _speed(
    kind: str,
    task: SceneTask,
    chain: ChainModel,
    frames: list[Frame],
    repeats: int,
    settings: dict[str, Any] = ENGINES["mujoco"],
) -> tuple[dict[str, float], Bar]:
    """Measure and print CPU times; return them and the bar."""
    cpu = _fastest(task, chain, frames, repeats, settings)
    ratio = cpu["plain"] / cpu["ours"]
    print(f"{kind:<13}" + "".join(f" {name} {value:.3f} s" for name, value in cpu.items()))
    print(f"{kind:<13} speed {ratio:.2f} × plain MuJoCo, {cpu['bare'] / cpu['ours']:.2f} × without laws")
    what = f"{kind}: speed against plain MuJoCo with the same laws"
    return cpu, Bar(what, ratio, SPEED, "×", at_most=False)


def _ramp(full: dict[str, float]) -> list[Frame]:
    """Return a ramp of the inputs and a hold."""
    shares = [min((k + 1) / FRAMES, 1.0) for k in range(2 * FRAMES)]
    return [({name: share * value for name, value in full.items()}, RAMP_S / FRAMES) for share in shares]


def _fastest(
    task: SceneTask, chain: ChainModel, frames: list[Frame], repeats: int, settings: dict[str, Any]
) -> dict[str, float]:
    """Return the least CPU seconds of the motion: in the engine, in plain MuJoCo, in MuJoCo without laws."""
    backend: Any = engine("mujoco", **settings)  # has scenes, which the interface of every engine lacks
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
                for inputs, duration_s in frames:
                    simulation.apply([Inputs(inputs)] * len(record.scene.arms))
                    simulation.step(duration_s)
                    record.see(simulation)
                cpu["ours"].append(time.process_time() - begun)
            model, data = laws.load(path)
            laws.resume()
            cpu["plain"].append(_stepped(model, data, frames))
            laws.pause()
            bare = mujoco.MjModel.from_xml_path(str(path))
            cpu["bare"].append(_stepped(bare, mujoco.MjData(bare), frames))
    return {name: min(values) for name, values in cpu.items()}


def _module(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module
    spec.loader.exec_module(module)
    return module


def _stepped(model: mujoco.MjModel, data: mujoco.MjData, frames: list[Frame]) -> float:
    """Return CPU seconds of the motion, reading the tip at each frame."""
    names = [model.actuator(k).name for k in range(model.nu)]
    ids = {one: [k for k, name in enumerate(names) if name.endswith(f"_{one}")] for one in frames[0][0]}
    begun = time.process_time()
    for inputs, duration_s in frames:
        for name, value in inputs.items():
            data.ctrl[ids[name]] = value
        for _ in range(round(duration_s / model.opt.timestep)):
            mujoco.mj_step(model, data)
        data.body("arm_0_tip").xpos.copy()
    return time.process_time() - begun


def _measured(
    task: SceneTask, chain: ChainModel, engines: dict[str, dict[str, Any]]
) -> dict[str, dict[str, float]]:
    """Return the numbers of each engine."""
    found = {}
    for kind, settings in engines.items():
        name, _, _ = kind.partition(",")
        if known(name):
            metrics = task.run(chain, scene_engine(engine(name, **settings), Model(chain))).metrics
            found[kind] = {name: v for name, v in metrics.items() if isinstance(v, float)}
            print(f"  {kind:<15}" + ", ".join(f"{name} {value:.5g}" for name, value in found[kind].items()))
    return found


if __name__ == "__main__":
    main()
