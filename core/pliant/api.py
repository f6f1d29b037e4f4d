"""The commands as functions of the same names, for notebooks and scripts.

    from pliant import api

    finger = api.open_study("finger.yaml")
    print(api.compare(finger).rmse_over_floor)
    print(api.diagnose(finger).selected)
    print(api.improve(finger).steps[-1].locked.over_floor)

Each returns the record that the command prints; only the artifact store is written.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from pliant.config.loading import load_study
from pliant.config.measurements import MeasurementsConfig
from pliant.config.study import Study
from pliant.diagnosis.candidates import candidate_kinds
from pliant.diagnosis.data_split import TrainTestSplit
from pliant.diagnosis.diagnosis import Diagnosis
from pliant.diagnosis.diagnosis import diagnose as diagnose_with
from pliant.diagnosis.extension import Extension, Ground
from pliant.diagnosis.extension import extend as extend_with
from pliant.diagnosis.improvement import improve as improve_with
from pliant.diagnosis.planning import FirstRuns, RunPlan, check_budget, plan_after
from pliant.diagnosis.planning import plan_first_runs as first_runs
from pliant.diagnosis.search import Tick
from pliant.diagnosis.steps import Improvement
from pliant.errors import UserError, closest
from pliant.evidence.compared import compare_model
from pliant.evidence.comparison import Comparison
from pliant.evidence.measured_model import MeasuredModel
from pliant.evidence.opening import measured_model, read_study_measurement
from pliant.execution.executors import Workers
from pliant.execution.progress import Progress, Silent
from pliant.experiments.experiment_catalogue import own_runs
from pliant.formatting import displayed_in
from pliant.interfaces.effect import AT
from pliant.interfaces.model import SystemModel
from pliant.interfaces.physics import PhysicsBackend
from pliant.inverse.statics import InverseStatics
from pliant.measurements.recording import read_recording
from pliant.measurements.system_reading import read_system_measurement
from pliant.measurements.written_units import units_as_written
from pliant.pipeline.carried import carried_chain
from pliant.pipeline.segments import DesignStages
from pliant.pipeline.study import (
    StudyRun,
    build_study_laws,
    check_study,
    simulate_study,
    solve_study_fem,
    study_physics,
)
from pliant.pipeline.workbench import RunContext
from pliant.records.measurement import Measurement
from pliant.registry.discovery import discover, left_out
from pliant.registry.function import package_function
from pliant.report.document import Document
from pliant.report.importing import import_document
from pliant.store.store import Artifact, ArtifactStore

DEFAULT_STORE = Path(".pliant/store")
CALIBRATE = "pliant_calibrate"  # package of the calibrations
DESIGNS = "pliant_designs"  # package of sweeps and meta-models
# Measurement files, patterns or pandas frames, read together in their order, or a measurement; None for the files
# that the study names.
Data = Any


@dataclass(frozen=True)
class OpenStudy:
    """A study with the plugins and the store that its stages need."""

    study: Study
    context: RunContext


def open_study(
    path: str | Path,
    overrides: Sequence[str] = (),
    *,
    store: str | Path = DEFAULT_STORE,
    progress: Progress | None = None,
) -> OpenStudy:
    """Read a study file.

    Args:
        path: the YAML file.
        overrides: as on the command line, ``["physics.kind=mujoco"]``.
        store: folder of finished stages.
        progress: receives the progress; silent by default.

    Raises:
        UserError: the file is missing or wrong; the message lists every problem.
    """
    context = workbench(store, progress)
    study = load_study(Path(path), context.registry, overrides, progress.note if progress else warnings.warn)
    registry = study.registry(context.registry)
    return OpenStudy(study, replace(context, registry=registry, store=ArtifactStore(Path(store), study.name)))


def workbench(store: str | Path = DEFAULT_STORE, progress: Progress | None = None) -> RunContext:
    """Return the installed plugins with a store, for functions that need no study."""
    return RunContext(discover(), ArtifactStore(Path(store)), progress or Silent())


def sweep(opened: OpenStudy, executor: Workers = None, workers: int | None = None) -> Any:
    """Solve the FEM data of all designs of the study's `sweep`: `pliant fem`.

    Args:
        opened: the study.
        executor: any `concurrent.futures.Executor`, a dask client's `get_executor()` among them; or the address or
            the file of a dask scheduler.
        workers: local processes instead; 1 solves in this process. By default the study's, or one for each CPU.

    A script that starts processes needs `if __name__ == "__main__":`.

    Returns:
        A `pliant_designs.sweep.SweepRun`.
    """
    return package_function("sweep", DESIGNS)(
        opened.context, opened.study, executor=executor, workers=workers
    )


def meta_model(opened: OpenStudy) -> Any:
    """Return the study's meta-model, after solving its designs if necessary: `pliant fit`.

    Returns:
        A `pliant_designs.unseen_designs.UnseenDesigns`.
    """
    return package_function("meta_model", DESIGNS)(opened)


def fem(opened: OpenStudy) -> tuple[Artifact, ...]:
    """Return the FEM data of each distinct design of the study: `pliant fem`."""
    opened.study.need("family", "FEM")
    check_study(opened.context, opened.study)
    return solve_study_fem(opened.context, opened.study)


def laws(opened: OpenStudy) -> tuple[DesignStages, ...]:
    """Return data and law of each distinct design of the study: `pliant fit`."""
    return build_study_laws(opened.context, opened.study)


def simulate(opened: OpenStudy) -> StudyRun:
    """Run all stages up to the study's task: `pliant simulate`."""
    return simulate_study(opened.context, opened.study)


def inverse(
    opened: OpenStudy,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    samples: int | None = None,
) -> InverseStatics:
    """Return the inverse statics of the robot: `solve` a target, follow a `path`, compute the `reachable` set.

    The task `reach` in a study does the same. The payload is that of the study's task; effects of the chain are
    applied.

    Args:
        opened: the study; an engine without gradients is differentiated by differences of settled states.
        bounds: low and high of inputs in SI; by default the domain of the law.
        samples: equilibria of the reachable set to start from.

    Raises:
        UserError: a study without a chain, or an input without bounds.
    """
    chain = carried_chain(opened.context, opened.study).chain
    physics = study_physics(opened.context, opened.study)
    backend: PhysicsBackend = opened.context.build("physics", physics)
    return InverseStatics(backend.build(chain), bounds, samples)


def optimize(opened: OpenStudy, executor: Workers = None, workers: int | None = None) -> Any:
    """Run the study's search and check the best design: `pliant optimize`; returns a `SearchResult`.

    Args:
        opened: a study with `search`.
        executor: any `concurrent.futures.Executor`, a dask client's `get_executor()` among them; or the address or
            the file of a dask scheduler.
        workers: local processes instead; 1 evaluates in this process. By default the study's, or one for each CPU.

    Raises:
        UserError: the study cannot be searched, or the package of searches is not installed.
        NotReachedError: the executor broke. A search without a feasible candidate has an empty `best`.
    """
    return package_function("optimize", "pliant_search")(opened, executor=executor, workers=workers).record


def read(files: Any, notes: Mapping[str, Any]) -> tuple[Measurement, Document]:
    """Read a recording without a study and document how it was understood: `pliant import`.

    Raises:
        UserError: see `read_recording`.
    """
    measurement, block = read_recording(files, notes)
    with displayed_in(units_as_written(measurement)):
        return measurement, import_document(measurement, block)


def read_for_model(opened: OpenStudy, files: Any, notes: Mapping[str, Any]) -> tuple[Measurement, Document]:
    """Read a recording by the channels of a study's own model and document how it was understood.

    Args:
        opened: a study with a `model`; the notes of its `measurements` hold here, too.
        files: a path, or several.
        notes: keys of a `measurements` block except `file`, which precede the study's.

    Raises:
        UserError: see `read_system_measurement`.
    """
    stated = opened.study.measurements
    known = {} if stated is None else stated.model_dump(exclude_defaults=True, exclude={"file"}, mode="json")
    named = [str(file) for file in files] if isinstance(files, list | tuple) else [str(files)]
    block = {"file": named[0] if len(named) == 1 else named, **known, **notes}
    assert opened.study.model is not None
    system = opened.context.build("model", opened.study.model)
    settings = MeasurementsConfig.model_validate(block)
    measurement = read_system_measurement(files, settings, system.inputs, system.outputs)
    with displayed_in(units_as_written(measurement)):
        return measurement, import_document(measurement, block)


def read_measurement(opened: OpenStudy, data: Data = None) -> Measurement:
    """Read the study's measurements, or other files by the same settings, as one measurement in their order."""
    if isinstance(data, Measurement):
        return data
    return read_study_measurement(opened.context, opened.study, data)


def predictor(opened: OpenStudy, data: Data = None) -> MeasuredModel:
    """Return the study's model, driven by the measured histories: a `Predictor` for a chain of modules."""
    return measured_model(opened.context, opened.study, read_measurement(opened, data))


def compare(opened: OpenStudy, data: Data = None) -> Comparison:
    """Compare the model with measurements: `pliant compare`."""
    model = predictor(opened, data)
    return compare_model(model)[1]


def compare_counts(opened: OpenStudy, data: str | Path | None = None, *, workers: Workers = None) -> Any:
    """Compare the study's task with a file of successes and trials: `pliant compare` on counts.

    Returns:
        A `pliant_counts.comparison.CountComparison`.
    """
    function = package_function("compare_counts", "pliant_counts")
    who = opened.study.resolve_workers(workers, 1)
    return function(opened.context, opened.study, None if data is None else Path(data), who)


def diagnose(
    opened: OpenStudy,
    data: Data = None,
    *,
    kinds: Sequence[str] | None = None,
    tick: Tick | None = None,
    workers: Workers = None,
) -> Diagnosis:
    """Diagnose which physical effect is missing: `pliant diagnose`; `tick` is called after each fitted hypothesis."""
    _warn_left_out(opened)
    model = predictor(opened, data)
    own = own_runs(opened.study, model)
    who = opened.study.resolve_workers(workers, 1)
    return diagnose_with(model, kinds=kinds, runs=own, tick=tick, workers=who)


def candidates(opened: OpenStudy, kinds: Sequence[str] | None = None) -> list[str]:
    """Return the kinds of effects that a diagnosis of the study tries; by default all that its model proposes.

    Raises:
        UserError: an unknown kind, or one without a number to fit.
    """
    found = candidate_kinds(opened.context.registry, kinds or None)
    if opened.study.model is None:
        return found
    system: SystemModel = opened.context.build("model", opened.study.model)
    if not kinds:
        return system.default_kinds(found)
    for kind in found:
        _check_place(opened.context, system, kind)
    return found


def _check_place(context: RunContext, system: SystemModel, kind: str) -> None:
    """Raise `UserError` for an effect at a place that the model does not have."""
    pattern = kind.partition(AT)[2]
    place = context.registry.get("effect", kind).implementation_class().place
    channels = {"input": system.inputs, "output": system.outputs}.get(place, ())
    names = [channel.name for channel in channels] or list(system.attachments.get(place, ()))
    if pattern and names and not any(fnmatchcase(name, pattern) for name in names):
        raise UserError(
            f"effect '{kind}' acts on no {place} of the model, which has {', '.join(names)}{closest(pattern, names)}"
        )


def plan(
    opened: OpenStudy,
    data: Data = None,
    *,
    kinds: Sequence[str] | None = None,
    runs: int | None = None,
    minutes: float | None = None,
    tick: Tick | None = None,
    workers: Workers = None,
) -> RunPlan:
    """Diagnose a recording and choose the runs that decide between the remaining explanations: `pliant plan`."""
    _warn_left_out(opened)
    check_budget(runs, minutes)
    model, who = predictor(opened, data), opened.study.resolve_workers(workers, 1)
    kinds = candidates(opened, kinds)
    return plan_after(model, opened.study, kinds, runs=runs, minutes=minutes, tick=tick, workers=who)


def plan_first_runs(
    opened: OpenStudy,
    *,
    kinds: Sequence[str] | None = None,
    runs: int | None = None,
    minutes: float | None = None,
) -> FirstRuns:
    """Choose the fewest runs that distinguish the effects, before any measurement: `pliant plan` without data."""
    _warn_left_out(opened)
    check_budget(runs, minutes)
    kinds = candidates(opened, kinds)
    return first_runs(opened.context, opened.study, kinds, runs=runs, minutes=minutes)


def _warn_left_out(opened: OpenStudy) -> None:
    for failure in left_out(opened.context.registry, ("effect",)):
        warnings.warn(f"left out: {failure.sentence}", stacklevel=3)


def extend(opened: OpenStudy, kinds: Sequence[str], data: Data = None) -> Extension:
    """Fit effects in addition to the study's own, with their uncertainty: `pliant extend`."""
    ground = Ground.from_study(opened.context, opened.study, read_measurement(opened, data))
    return extend_with(ground, opened.study.effects, kinds)


def improve(
    opened: OpenStudy,
    data: Data = None,
    *,
    kinds: Sequence[str] | None = None,
    learned: bool = False,
    named_only: bool = False,
    tick: Tick | None = None,
    workers: Workers = None,
    split: TrainTestSplit | None = None,
) -> Improvement:
    """Run the whole loop with held-out runs: `pliant improve`.

    Args:
        opened, data: the model and the recording.
        kinds: candidates; all effects by default.
        learned: whether a learned term may be the last step.
        named_only: add only effects that a verdict names.
        tick: called with the name of each hypothesis when it has been fitted.
        workers: where hypotheses are fitted.
        split: the held-out runs, if they were chosen before.
    """
    _warn_left_out(opened)
    measurement = read_measurement(opened, data)
    return improve_with(
        opened.context,
        opened.study,
        measurement,
        kinds=kinds,
        learned=learned,
        named_only=named_only,
        tick=tick,
        split=split,
        workers=opened.study.resolve_workers(workers, 1),
    )


def calibrate(
    opened: OpenStudy,
    data: str | Path,
    *,
    test: str | None = None,
    fit: Sequence[str] | None = None,
) -> Any:
    """Fit constants of the study's material to a tensile test or a free curve: `pliant calibrate`.

    Returns:
        A `pliant_calibrate.result.Calibration`.
    """
    function = package_function("calibrate", CALIBRATE)
    return function(opened.context, opened.study, Path(data), test, fit)


def fit_stated_law(opened: OpenStudy, data: Data = None, *, held: Sequence[str] = ()) -> Any:
    """Fit the coefficients of the study's stated law to measured runs, with its effects applied.

    Returns:
        A `pliant_calibrate.stated_law_fit.LawOfRuns`.
    """
    function = package_function("fit_stated_law", CALIBRATE)
    return function(opened.context, opened.study, read_measurement(opened, data), held=held)
