"""Shared by the grasp benchmarks: the published gripper of examples/grasp/egg.yaml, the task, the code in use."""

from __future__ import annotations

from functools import cache
from typing import Any

from benchmarks.output import ROOT, component, registry, workbench

from pliant.config.loading import load_study
from pliant.pipeline.study import build_study_chain
from pliant.records.chain import ChainModel
from pliant.store.fingerprint import code_fingerprint
from pliant_plugins.tasks.grasp.task import Grasp

STUDY = ROOT / "examples" / "grasp" / "egg.yaml"


@cache
def finger(*overrides: str) -> ChainModel:
    """Return one finger with a law from FEM; overrides of the study as on the command line."""
    return build_study_chain(workbench(), load_study(STUDY, registry(), list(overrides))).chain


def grasp(**settings: Any) -> Grasp:
    """Return the task with some settings, keys as in a study."""
    return component("task", "grasp", **settings)


def engine_code_digest(*engines: str) -> str:
    """Return fingerprint of the code of the task and of engines."""
    modules = (f"pliant_plugins.physics.{kind}.backend" for kind in engines)
    return code_fingerprint(["pliant_plugins.tasks.grasp.task", *modules], {"pliant", "pliant_plugins"})
