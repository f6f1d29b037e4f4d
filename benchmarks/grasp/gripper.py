"""What the grasp benchmarks share: the published gripper of examples/grasp/egg.yaml, the task, the code in use."""

from __future__ import annotations

from functools import cache
from typing import Any

from benchmarks.output import ROOT, component, registry, workbench

from pliant.config.loading import load_study
from pliant.pipeline.study import chain_of_study
from pliant.records.chain import ChainModel
from pliant.store.fingerprint import code_fingerprint
from pliant_plugins.tasks.grasp.task import Grasp

STUDY = ROOT / "examples" / "grasp" / "egg.yaml"


@cache
def finger(*overrides: str) -> ChainModel:
    """One finger, law from FEM; overrides of the study as on the command line."""
    return chain_of_study(workbench(), load_study(STUDY, registry(), list(overrides))).chain


def grasp(**settings: Any) -> Grasp:
    """The task with some settings, keys as in a study."""
    return component("task", "grasp", **settings)


def code_of(*engines: str) -> str:
    """Fingerprint of the code of the task and of engines."""
    modules = (f"pliant_plugins.physics.{kind}.backend" for kind in engines)
    return code_fingerprint(["pliant_plugins.tasks.grasp.task", *modules], {"pliant", "pliant_plugins"})
