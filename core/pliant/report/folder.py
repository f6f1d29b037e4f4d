"""The folder of a finished run: everything that a report needs, readable on another machine.

run.json      the result of the command (contracts.md) with the provenance of every artifact
study.json    the study with all defaults, SI
fem.csv       the data set(s) as a table
data/…        the artifacts themselves
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pliant.errors import UserError
from pliant.pipeline.study import StudyRun
from pliant.pipeline.tables import write_table
from pliant.records.fem import FemDataset
from pliant.records.law import FitReport, JointLaw
from pliant.records.rollout import TaskResult
from pliant.registry.discovery import Registry
from pliant.store.store import Artifact, CorruptedError, load_artifact, write_atomically


@dataclass(frozen=True)
class DesignResult:
    """One design: its data (None for a stated law), law, errors on states left out (None for a stated law)."""

    name: str
    fem: FemDataset | None
    law: JointLaw
    fit: FitReport | None


@dataclass(frozen=True)
class EngineResult:
    """One engine: its result, or the reason why it was skipped."""

    kind: str
    result: TaskResult | None
    skipped: str = ""


@dataclass(frozen=True)
class FinishedRun:
    """A run folder, read.

    `summary` is run.json; `provenance` holds one manifest per artifact, in the order of the stages.
    """

    summary: Mapping[str, Any]
    study: Mapping[str, Any]
    designs: tuple[DesignResult, ...]
    engines: tuple[EngineResult, ...]
    provenance: tuple[Mapping[str, Any], ...]


def finished(run: StudyRun, summary: Mapping[str, Any]) -> FinishedRun:
    """A run in memory as what a report reads."""
    designs = tuple(
        DesignResult(_design_name(number, run), d.fem.value if d.fem else d.law.data, d.law.law, d.law.report)
        for number, d in enumerate(run.designs)
    )
    engines = tuple(EngineResult(e.kind, e.result, e.skipped) for e in run.engines)
    manifests = tuple(artifact.manifest for _, artifact in _artifacts(run))
    return FinishedRun(summary, run.study.canonical(), designs, engines, manifests)


def write_folder(folder: Path, run: StudyRun, summary: Mapping[str, Any]) -> None:
    """Write a run's folder; files of an earlier run in it are replaced one by one."""
    names = []
    for name, artifact in _artifacts(run):
        target = folder / "data" / name
        _replace_copy(artifact.folder, target)
        names.append(name)
    for number, design in enumerate(run.designs):
        if design.fem is not None:
            write_table(design.fem.value, folder / table_name(number))
    index = {"summary": summary, "artifacts": names, "engines": [[e.kind, e.skipped] for e in run.engines]}
    write_atomically(folder / "study.json", json.dumps(run.study.canonical(), indent=1))
    write_atomically(folder / "run.json", json.dumps(index, indent=1))


def read_folder(folder: Path, registry: Registry) -> FinishedRun:
    """Read a run's folder; raises `UserError` when it is none or was damaged."""
    try:
        index = json.loads((folder / "run.json").read_text())
        study = json.loads((folder / "study.json").read_text())
        artifacts = {name: load_artifact(folder / "data" / name) for name in index["artifacts"]}
    except (FileNotFoundError, NotADirectoryError):
        raise UserError(
            f"{folder} holds no finished run (no run.json); give the --out folder of 'pliant run'."
        ) from None
    except (CorruptedError, ValueError, KeyError) as error:
        raise UserError(f"{folder} is damaged ({error}); run the study again.") from None
    designs = _read_designs(artifacts, study, registry)
    engines = tuple(
        EngineResult(kind, a.value if (a := artifacts.get(_engine_name(n, kind))) else None, skipped)
        for n, (kind, skipped) in enumerate(index["engines"])
    )
    manifests = tuple(artifact.manifest for artifact in artifacts.values())
    return FinishedRun(index["summary"], study, designs, engines, manifests)


def table_name(number: int) -> str:
    """File name of a design's table."""
    return "fem.csv" if number == 0 else f"fem_{number + 1}.csv"


def _artifacts(run: StudyRun) -> list[tuple[str, Artifact]]:
    found: list[tuple[str, Artifact]] = []
    for number, design in enumerate(run.designs):
        if design.fem is not None:
            found.append((f"fem{number}", design.fem))
        if design.law.artifact is not None:
            found.append((f"fit{number}", design.law.artifact))
    for number, engine in enumerate(run.engines):
        if engine.artifact is not None:
            found.append((_engine_name(number, engine.kind), engine.artifact))
    return found


def _engine_name(number: int, kind: str) -> str:
    return f"simulate{number}_{kind}"


def _design_name(number: int, run: StudyRun) -> str:
    return run.study.name if len(run.designs) == 1 else f"{run.study.name} design {number + 1}"


def _read_designs(
    artifacts: Mapping[str, Artifact], study: Mapping[str, Any], registry: Registry
) -> tuple[DesignResult, ...]:
    config = study.get("surrogate") or {"kind": "polynomial"}
    component = registry.get("surrogate", config["kind"])
    surrogate = component.build(component.config_model().model_validate(config))
    stated = surrogate.stated()
    if stated is not None:
        return (DesignResult(study["name"], None, stated, None),)
    designs = []
    count = sum(name.startswith("fit") for name in artifacts)
    for number in range(count):
        value = artifacts[f"fit{number}"].value
        fem = artifacts.get(f"fem{number}")
        name = study["name"] if count == 1 else f"{study['name']} design {number + 1}"
        law = surrogate.load(value["law"])
        designs.append(DesignResult(name, fem.value if fem else None, law, value["report"]))
    return tuple(designs)


def _replace_copy(source: Path, target: Path) -> None:
    if (target / "manifest.json").is_file() and (
        (target / "manifest.json").read_bytes() == (source / "manifest.json").read_bytes()
    ):
        return
    fresh = target.with_name(target.name + ".new")
    shutil.rmtree(fresh, ignore_errors=True)
    shutil.copytree(source, fresh)
    shutil.rmtree(target, ignore_errors=True)
    fresh.rename(target)
