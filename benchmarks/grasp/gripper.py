"""What the grasp benchmarks share: the published gripper of examples/grasp/egg.yaml, engines, episodes, files."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
if str(ROOT) not in sys.path:  # run as a script
    sys.path.insert(0, str(ROOT))
os.environ.setdefault("OMP_NUM_THREADS", "1")

from pliant.config.loading import load_study  # noqa: E402 - after the environment is set
from pliant.interfaces.effect import Model  # noqa: E402
from pliant.interfaces.physics import PhysicsBackend  # noqa: E402
from pliant.pipeline.study import chain_of_study  # noqa: E402
from pliant.pipeline.workbench import Workbench  # noqa: E402
from pliant.records.chain import ChainModel  # noqa: E402
from pliant.registry.discovery import Registry, discover  # noqa: E402
from pliant.store.store import ArtifactStore  # noqa: E402
from pliant_plugins.tasks.grasp.task import Grasp  # noqa: E402

STUDY = ROOT / "examples" / "grasp" / "egg.yaml"


@cache
def registry() -> Registry:
    """The installed plugins."""
    return discover()


@cache
def finger(*overrides: str) -> ChainModel:
    """One finger, law from FEM; overrides of the study as on the command line."""
    bench = Workbench(registry(), ArtifactStore(ROOT / ".pliant" / "store"))
    return chain_of_study(bench, load_study(STUDY, registry(), list(overrides))).chain


def with_effect(chain: ChainModel, kind: str, **settings: Any) -> ChainModel:
    """The chain with an effect in its laws."""
    return _built("effect", kind, settings).apply(Model(chain)).chain


def engine(kind: str, **settings: Any) -> PhysicsBackend:
    """An engine."""
    return _built("physics", kind, settings)


def grasp(**settings: Any) -> Grasp:
    """The task with some settings, keys as in a study."""
    return _built("task", "grasp", settings)


def held(backend: PhysicsBackend, chain: ChainModel, extra_kg: float, **settings: Any) -> bool:
    """Whether the object with this extra mass at its centre is lifted and stays."""
    weights = {"extra_weights": 1, "weight_kg": extra_kg} if extra_kg > 0 else {}
    task = grasp(**settings, **weights)
    return bool(task.run(chain, backend.build_scene).metrics["mode"] == "stable")


def _built(interface: str, kind: str, settings: Mapping[str, Any]) -> Any:
    component = registry().get(interface, kind)
    return component.build(component.config_model().model_validate({"kind": kind, **settings}))
