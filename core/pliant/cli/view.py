"""`pliant view`: the interactive window."""

from __future__ import annotations

from typing import Annotated

import numpy as np
import typer

from pliant.cli.options import DEFAULT_STORE, Overrides, Quiet, StoreFolder, StudyFile
from pliant.cli.render import ViewerKind
from pliant.cli.session import session
from pliant.config.study import Study
from pliant.interfaces.task import SceneTask
from pliant.interfaces.viewer import Viewer
from pliant.pipeline.motion import (
    ChainHandle,
    chain_frames,
    chain_scene,
    drawn_chain,
    highest_actuation,
    motion_of_run,
    prepared_chain,
)
from pliant.pipeline.study import StudyRun, laws_of_study, simulate_study
from pliant.pipeline.workbench import Workbench
from pliant.records.motion import Motion
from pliant.records.rollout import Inputs


def view(
    study: StudyFile,
    overrides: Overrides = None,
    replay: Annotated[
        bool, typer.Option("--replay", help="Replay the task; else sliders drive the chain.")
    ] = False,
    viewer: ViewerKind = "mujoco",
    store: StoreFolder = DEFAULT_STORE,
    quiet: Quiet = False,
) -> None:
    """Open a window: move the pressure by a slider, or replay what the task did (scenes always)."""
    with session("view", None, quiet) as here:
        drawer = here.registry.get("viewer", viewer)
        built: Viewer = drawer.build(drawer.config_model()(kind=viewer))
        built.require_display()
        loaded = here.study(study, overrides).model_copy(update={"cross_check": ()})
        bench = here.bench(store)
        scene = loaded.task is not None and isinstance(bench.build("task", loaded.task), SceneTask)
        if replay or scene:
            built.show(motion_of_run(bench, simulate_study(bench, loaded)))
        else:
            _drive(bench, loaded, built)


def _drive(bench: Workbench, study: Study, viewer: Viewer) -> None:
    chain, backend, _ = prepared_chain(bench, study)
    highest = highest_actuation(study, chain)
    looks = drawn_chain(bench, StudyRun(study, laws_of_study(bench, study)))
    with backend.build(chain) as simulation:
        rest = simulation.snapshot()
        names = dict.fromkeys(actuator.input for actuator in chain.actuators)
        poses = [rest.position]
        for share in (0.5, 1.0):
            simulation.apply(Inputs(dict.fromkeys(names, share * highest)))
            poses.append(simulation.settle().joint_angles)
        simulation.restore(rest)
        frames = chain_frames(np.arange(3.0), np.array(poses))
        worn = chain.with_(shapes=looks.shapes)
        viewer.show(Motion(chain_scene(worn), frames), ChainHandle(simulation, highest))
