"""Tasks in contact: CPU time against plain MuJoCo with the same scene and laws, and the engines' agreement.

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
from pathlib import Path
from types import ModuleType
from typing import Any

import mujoco
from benchmarks.grasp.gripper import finger
from benchmarks.output import ROOT, Bar, component, engine, known, make_parser, registry, workbench, write

from pliant.config.loading import load_study
from pliant.interfaces.effect import Model
from pliant.interfaces.task import SceneTask
from pliant.pipeline.simulate import scene_engine
from pliant.pipeline.study import build_study_chain
from pliant.records.chain import ChainModel
from pliant.records.rollout import Inputs
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
        "distances": ["0 mm"],
    },
}
COMPARED = {"reach_around": ("distance_m", "press_n"), "push": ("holding_force_n",)}
HARD = {"contact_stiffness": 1e6, "contact_damping": 2e3, "contact_timestep": "0.5 ms"}
ENGINES: dict[str, dict[str, Any]] = {
    "quasistatic": {},
    "mujoco": {"joint_damping": 3e-3, **HARD},
    "pybullet": {"joint_damping": 1e-3},
}
CRAWLER = ROOT / "examples" / "crawl" / "crawler.yaml"
DAMPED = {"joint_damping": 1e-3}
CRAWLERS: dict[str, dict[str, Any]] = {
    "mujoco": {**DAMPED, **HARD, "slip_damping": 3e3, "contact_timestep": "0.1 ms"},
    "pybullet": {**DAMPED, "friction_anchors": False},
    "mujoco, example": {**DAMPED, **HARD, "slip_damping": 1e3},
}
FULL = {"reach_around": 12e3, "push": 15e3}
RAMP_S, FRAMES = 2.0, 25
SPEED, AGREE = 0.8, 0.01


def main() -> None:
    """Compare every task with plain MuJoCo, interleaved, then the engines with each other."""
    quick = make_parser(__doc__, "fewer repeats").parse_args().quick
    chain, bars = finger(), []
    result: dict[str, Any] = {}
    for kind, block in TASKS.items():
        task: SceneTask = component("task", kind, **block)
        cpu, bar = _speed(kind, task, chain, _ramp(FULL[kind]), 2 if quick else 5)
        bars.append(bar)
        measured = _measured(task, chain, ENGINES)
        for name in COMPARED[kind]:
            still = measured["quasistatic"][name]
            for other in (k for k in measured if k != "quasistatic"):
                away = abs(measured[other][name] - still) / abs(still)
                bars.append(Bar(f"{kind}: {name}, {other} against quasistatic", away, AGREE, "%", scale=100))
        result[kind] = {"cpu_s": cpu, "ratio": bar.reached, "metrics": measured}
    result["crawl"] = _crawl(bars, 2 if quick else 5)
    write("tasks_speed", result, bars)


def _crawl(bars: list[Bar], repeats: int) -> dict[str, Any]:
    """Compare the hand-made crawler of the examples; add its bars."""
    study = load_study(CRAWLER, registry())
    chain = build_study_chain(workbench(), study).chain
    assert study.task is not None
    task = Crawl(study.task)  # type: ignore[arg-type]
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


def _ramp(full: float) -> list[Frame]:
    """Return a ramp of the pressure and a hold."""
    shares = [min((k + 1) / FRAMES, 1.0) for k in range(2 * FRAMES)]
    return [({"pressure_pa": full * share}, RAMP_S / FRAMES) for share in shares]


def _fastest(
    task: SceneTask, chain: ChainModel, frames: list[Frame], repeats: int, settings: dict[str, Any]
) -> dict[str, float]:
    """Return the least CPU seconds of the motion: in the engine, in plain MuJoCo, in MuJoCo without laws."""
    backend = engine("mujoco", **settings)
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
                    simulation.apply([Inputs(inputs)])
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
    ids = {name: model.actuator(f"arm_0_{name}").id for name in frames[0][0]}
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
