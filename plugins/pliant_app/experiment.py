"""The live page of an experiment: `pliant app --experiment DIR` follows the folder that `pliant experiment` writes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from pliant.errors import UserError
from pliant_bench.loop.folder import ExperimentFolder
from pliant_bench.loop.live import LiveState, press_stop

PAGE = "experiment.html"
Answers = dict[str, Callable[[Mapping[str, Any]], Any]]


def experiment_folder(path: Path) -> ExperimentFolder:
    """Return the folder of an experiment; raise `UserError` for another one."""
    if not (path / "experiment.json").is_file():
        raise UserError(
            f"{path} is no folder of an experiment; 'pliant experiment STUDY.yaml' prints its folder."
        )
    return ExperimentFolder(path)


def reading(folder: ExperimentFolder) -> Answers:
    """Return the answers to the page's questions."""
    state = LiveState(folder)
    return {
        "state": lambda v: state.read(int(v.get("run", 0)), int(v.get("since", 0)), int(v.get("models", -1)))
    }


def writing(folder: ExperimentFolder) -> Answers:
    """Return the answers to the page's orders."""
    return {"vent": lambda v: press_stop(folder)}
