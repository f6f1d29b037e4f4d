"""The folder of a finished run: all data of its report, readable on another machine.

run.json      the result of the command (docs/command_line.md), and the role of each file
study.json    the study with all defaults, SI
fem.csv       the data set(s) as a table
data/…        the artifacts themselves, and the tables that were fitted instead of FEM data
"""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pliant.config.design_parameters import material_parameters
from pliant.errors import UserError
from pliant.fem_tables.reading import read_table
from pliant.fem_tables.writing import write_table
from pliant.mechanics.one_input import first_input_law
from pliant.pipeline.plugins_used import find_run_component, used_plugins
from pliant.pipeline.segments import DesignStages
from pliant.pipeline.study import DEFAULT_SURROGATE, StudyRun
from pliant.records.design import Array
from pliant.records.fem import FemDataset, ModuleData
from pliant.records.law import FitReport, JointLaw
from pliant.records.load_frames import LoadFrames
from pliant.records.rollout import TaskResult
from pliant.registry.block import blocks, kind_blocks
from pliant.registry.discovery import Registry
from pliant.registry.law_source import law_sources
from pliant.registry.place import imported
from pliant.registry.shipped import REMEDY, shipped_in
from pliant.store.store import Artifact, CorruptedError, load_artifact, write_atomically, writing_in

TABLE = re.compile(r"fem(_\d+)?\.csv|data/table\d+\.csv")
UNCERTAINTY, LOADS = "uncertainty", "loads"
ARTIFACT = re.compile(rf"(fem|fit)\d+|simulate\d+_\w[\w.-]*|{UNCERTAINTY}|{LOADS}")


@dataclass(frozen=True)
class DesignResult:
    """One design: its data (None for a stated law), law, errors on held-out states (None for a stated law).

    `module` is the FEM stage's whole result, all axes, if the law was fitted to FEM data.
    """

    name: str
    fem: FemDataset | None
    law: JointLaw
    fit: FitReport | None
    module: ModuleData | None = None


@dataclass(frozen=True)
class EngineResult:
    """The result of an engine."""

    kind: str
    result: TaskResult

    @property
    def markers_m(self) -> Array:
        """(n + 2, 3) settled markers."""
        return self.result.final.markers_m


@dataclass(frozen=True)
class FinishedRun:
    """The contents of a run folder.

    `summary` is the result of the command; `provenance` has one manifest per artifact, in the order of the stages;
    `segment_designs` gives the index in `designs` of each segment of the chain; `uncertainty` is the result of
    `pliant.pipeline.simulate.spread` for runs with drawn laws, if the study requests them; `engines` ran, in the
    study's order, `skipped` did not: kind and cause; `loads` are the first engine's poses under other loads.
    """

    summary: Mapping[str, Any]
    study: Mapping[str, Any]
    designs: tuple[DesignResult, ...]
    engines: tuple[EngineResult, ...]
    provenance: tuple[Mapping[str, Any], ...]
    segment_designs: tuple[int, ...] = ()
    uncertainty: Mapping[str, Any] | None = None
    skipped: tuple[tuple[str, str], ...] = ()
    loads: LoadFrames | None = None

    def named(self, design: DesignResult) -> str:
        """Return the design's name as the beginning of a sentence or a title; empty if there is one design."""
        return f"{design.name}: " if len(self.designs) > 1 else ""


def finished(run: StudyRun, summary: Mapping[str, Any]) -> FinishedRun:
    """Return a run in memory in the form that a report reads."""
    designs = tuple(
        _several_input_design(_design_name(number, run), d.law.law, d.law.report)
        if len(d.law.law.actuations) > 1
        else DesignResult(
            _design_name(number, run),
            _main(d.fem) if d.fem else d.law.data,
            d.law.law,
            d.law.report,
            d.fem.value if d.fem else None,
        )
        for number, d in enumerate(run.designs)
    )
    engines = tuple(EngineResult(e.kind, e.result) for e in run.engines if e.result is not None)
    skipped = tuple((e.kind, e.skipped) for e in run.engines if e.result is None)
    manifests = tuple(artifact.manifest for _, artifact in _artifacts(run))
    spread = run.uncertainty.value if run.uncertainty is not None else None
    loads = run.loads.value if run.loads is not None else None
    return FinishedRun(
        summary,
        run.study.canonical(),
        designs,
        engines,
        manifests,
        run.segment_designs,
        spread,
        skipped,
        loads,
    )


def write_folder(folder: Path, run: StudyRun, summary: Mapping[str, Any]) -> None:
    """Write a run's folder; files of an earlier run are replaced or removed.

    `run.json` is removed first and written last: a folder with this file is complete.
    """
    with writing_in(folder):
        artifacts = _artifacts(run)
        _remove_earlier(folder, {name for name, _ in artifacts})
        for name, artifact in artifacts:
            _replace_copy(artifact.folder, folder / "data" / name)
        tables = []
        for number, design in enumerate(run.designs):
            if design.fem is not None:
                tables.append(table_name(number))
                rubber = run.study.material
                constants = None if rubber is None else material_parameters(rubber)
                write_table(design.fem.value, folder / tables[-1], constants)
            elif design.law.data is not None:
                tables.append(_foreign_table(number))
                write_table(design.law.data, folder / tables[-1])
        index = {
            "summary": summary,
            "artifacts": [name for name, _ in artifacts],
            "tables": tables,
            "designs": [_design_name(number, run) for number in range(len(run.designs))],
            "surrogates": [c.canonical() if (c := d.design.surrogate) else None for d in run.designs],
            "families": [f.canonical() if (f := d.design.family) else None for d in run.designs],
            **{f"{key}s": [_shared_values(design, key) for design in run.designs] for key in law_sources()},
            "segment_designs": run.segment_designs,
            "engines": [[e.kind, e.skipped] for e in run.engines],
            "plugins": used_plugins([artifact.manifest for _, artifact in artifacts]),
        }
        write_atomically(folder / "study.json", json.dumps(run.study.canonical(), indent=1))
        write_atomically(folder / "run.json", json.dumps(index, indent=1))


def read_folder(folder: Path, registry: Registry) -> FinishedRun:
    """Read a run's folder; raises `UserError` for another or a damaged folder."""
    try:
        index = json.loads((folder / "run.json").read_text())
        study = json.loads((folder / "study.json").read_text())
        if not isinstance(study, dict) or "name" not in study:
            raise ValueError("study.json holds no study")
        artifacts = {name: load_artifact(folder / "data" / name) for name in index["artifacts"]}
        designs = _read_designs(folder, index, artifacts, study, registry)
        made = [(kind, cause, _engine_name(n, kind)) for n, (kind, cause) in enumerate(index["engines"])]
        engines = tuple(EngineResult(kind, artifacts[a].value) for kind, _, a in made if a in artifacts)
        skipped = tuple((kind, cause) for kind, cause, a in made if a not in artifacts)
        segments = tuple(int(number) for number in index["segment_designs"])
        manifests = tuple(artifact.manifest for artifact in artifacts.values())
        spread = artifacts[UNCERTAINTY].value if UNCERTAINTY in artifacts else None
        loads = artifacts[LOADS].value if LOADS in artifacts else None
        return FinishedRun(
            index["summary"], study, designs, engines, manifests, segments, spread, skipped, loads
        )
    except (FileNotFoundError, NotADirectoryError):
        raise UserError(
            f"{folder} holds no finished run (no run.json); give the --out folder of 'pliant run'."
        ) from None
    except OSError as error:
        raise UserError(f"{folder} cannot be read ({error.strerror}).") from None
    except (CorruptedError, ValueError, LookupError, TypeError, AttributeError, RecursionError) as error:
        cause = str(error) if isinstance(error, CorruptedError) else f"{type(error).__name__}: {error}"
        raise UserError(f"{folder} is damaged ({cause}); run the study again.") from None


def table_name(number: int) -> str:
    """Return the file name of a design's table."""
    return "fem.csv" if number == 0 else f"fem_{number + 1}.csv"


def _foreign_table(number: int) -> str:
    """Return the path of a table to which a design's law was fitted instead of FEM data."""
    return f"data/table{number}.csv"


def _main(fem: Artifact) -> FemDataset:
    """Return the data of the main axis."""
    data: ModuleData = fem.value
    return data.axis(data.main_axis)


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
    if run.uncertainty is not None:
        found.append((UNCERTAINTY, run.uncertainty))
    if run.loads is not None:
        found.append((LOADS, run.loads))
    return found


def _engine_name(number: int, kind: str) -> str:
    return f"simulate{number}_{kind}"


def _design_name(number: int, run: StudyRun) -> str:
    return run.study.name if len(run.designs) == 1 else f"{run.study.name} design {number + 1}"


def _read_designs(
    folder: Path,
    index: Mapping[str, Any],
    artifacts: Mapping[str, Artifact],
    study: Mapping[str, Any],
    registry: Registry,
) -> tuple[DesignResult, ...]:
    # A folder of an older version has one surrogate for all designs.
    configs = index.get("surrogates") or [study.get("surrogate")] * len(index["designs"])
    built, designs = _Built(registry, folder, index), []
    for number, (name, written) in enumerate(zip(index["designs"], configs, strict=True)):
        if key := _source_key(index, number):
            shared = built.build(kind_blocks()[key], {**index[f"{key}s"][number], "data": None})
            made = artifacts[f"fit{number}"].value
            law = imported(law_sources()[key].read)(shared, made)
            designs.append(DesignResult(name, None, law, made["report"]))
            continue
        config = dict(written or {"kind": DEFAULT_SURROGATE})
        config["data"] = None  # the file may have moved; the fitted data are in the folder
        surrogate = built.build("surrogate", config)
        fit = artifacts.get(f"fit{number}")
        if fit is None:
            families = index.get("families") or [None] * len(configs)
            family, material = (
                built.build("family", families[number]),
                built.build("material", study.get("material")),
            )
            law = family.closed_form(material) if written is None and family is not None else None
            if law is None and (law := surrogate.stated_for(family, material)) is None:
                raise KeyError(f"fit{number}")
            designs.append(DesignResult(name, None, law, None))
            continue
        law = surrogate.load(fit.value["law"])
        if len(law.actuations) > 1:
            designs.append(_several_input_design(name, law, fit.value["report"]))
            continue
        table = _foreign_table(number)
        if table in index["tables"]:
            data: FemDataset | None = read_table(folder / table)
            module = None
        else:
            source = artifacts[f"fem{number}"]
            data, module = _main(source), source.value
        designs.append(DesignResult(name, data, law, fit.value["report"], module))
    return tuple(designs)


@dataclass(frozen=True)
class _Built:
    """The plugins of a run's folder, built from its blocks."""

    registry: Registry
    folder: Path
    index: Mapping[str, Any]

    def build(self, interface: str, block: Mapping[str, Any] | None) -> Any:
        """Return the plugin of a block; None without one."""
        if block is None:
            return None
        find_run_component(self.registry, interface, str(block["kind"]), self.folder, self.index)
        return self.registry.build(
            interface, self.registry.config_model(interface, block).model_validate(block)
        )


def _several_input_design(name: str, law: JointLaw, report: FitReport | None) -> DesignResult:
    """Return a design of several actuations: pictures show its law under the first alone, without states."""
    return DesignResult(name, None, first_input_law(law), report, None)


def _shared_values(design: DesignStages, key: str) -> dict[str, Any] | None:
    """Return the values of the block `key` if the law of a design comes from it."""
    shared = design.design.shared
    return shared.canonical() if shared is not None and design.design.source == key else None


def _source_key(index: Mapping[str, Any], number: int) -> str:
    """Return the key of the `LawSource` of a design's law; "" for a law of its own."""
    for key in (name.removesuffix("s") for name, values in index.items() if values and name.endswith("s")):
        if key in law_sources() and index[f"{key}s"][number] is not None:
            return key
        package = shipped_in(key)
        if package and key not in blocks() and index[f"{key}s"][number] is not None:
            raise UserError(
                f"the law of {index['designs'][number]} belongs to the package {package}, {REMEDY}."
            )
    return ""


def _remove_earlier(folder: Path, keep: Collection[str]) -> None:
    """Remove run.json and the files of the earlier run that it lists, except artifacts to keep."""
    index = folder / "run.json"
    try:
        earlier = json.loads(index.read_text())
        tables = [name for name in earlier["tables"] if TABLE.fullmatch(name)]
        unwanted = [name for name in earlier["artifacts"] if ARTIFACT.fullmatch(name) and name not in keep]
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        tables, unwanted = [], []
    index.unlink(missing_ok=True)
    for name in tables:
        (folder / name).unlink(missing_ok=True)
    for name in unwanted:
        shutil.rmtree(folder / "data" / name, ignore_errors=True)


def _replace_copy(source: Path, target: Path) -> None:
    """Copy an artifact, unless the same one is there and sound."""
    try:
        if load_artifact(target).manifest == load_artifact(source).manifest:
            return
    except (CorruptedError, UserError):
        pass
    with replaced_folder(target) as fresh:
        shutil.copytree(source, fresh)


@contextmanager
def replaced_folder(target: Path) -> Iterator[Path]:
    """Yield the path of a new folder, which replaces `target` as a whole."""
    fresh = target.with_name(target.name + ".new")
    shutil.rmtree(fresh, ignore_errors=True)
    yield fresh
    shutil.rmtree(target, ignore_errors=True)
    fresh.rename(target)
