"""The commands as functions, in the same words: for notebooks and scripts.

    from pliant import api

    finger = api.open_study("finger.yaml")
    print(api.compare(finger).rmse_over_floor)
    print(api.diagnose(finger).selected)
    print(api.improve(finger).steps[-1].locked.over_floor)

Each returns the record that the command prints; nothing is written but the artifact store.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from pliant.calibration.calibration import calibrate as calibrate_with
from pliant.calibration.law_of_runs import LawOfRuns
from pliant.calibration.law_of_runs import law_of_runs as law_of_runs_with
from pliant.calibration.reading import read_bench_data
from pliant.calibration.result import Calibration
from pliant.config.loading import load_study
from pliant.config.problems import sentences
from pliant.config.study import Study, varied
from pliant.diagnosis.diagnosis import Diagnosis
from pliant.diagnosis.diagnosis import diagnose as diagnose_with
from pliant.diagnosis.extension import Extension, Ground
from pliant.diagnosis.extension import extend as extend_with
from pliant.diagnosis.improvement import improve as improve_with
from pliant.diagnosis.steps import Improvement
from pliant.errors import UserError
from pliant.evidence.compared import compare_model
from pliant.evidence.comparison import Comparison
from pliant.evidence.counts import CountComparison, compare_counted, counted_study
from pliant.evidence.prediction import Predictor, measurement_of_study
from pliant.execution.executors import Workers
from pliant.execution.progress import Progress, Silent
from pliant.experiments.experiment_catalogue import own_runs
from pliant.interfaces.physics import PhysicsBackend
from pliant.inverse.statics import InverseStatics
from pliant.pipeline.carried import carried_chain
from pliant.pipeline.meta_model.cross_validation import Scores
from pliant.pipeline.meta_model.next_design import Proposal, designs_to_solve
from pliant.pipeline.meta_model.stage import MetaModelStage, meta_model_stage
from pliant.pipeline.segments import DesignStages
from pliant.pipeline.study import (
    StudyRun,
    check_study,
    fem_of_study,
    laws_of_study,
    physics_of_study,
    simulate_study,
)
from pliant.pipeline.sweep import SweepRun, sweep_study
from pliant.pipeline.workbench import Workbench
from pliant.records.law import JointLaw
from pliant.records.measurement import Measurement
from pliant.records.search import SearchResult
from pliant.registry.discovery import discover
from pliant.registry.files import with_files
from pliant.report.importing import read as read
from pliant.search.stage import search_study
from pliant.store.store import Artifact, ArtifactStore

DEFAULT_STORE = Path(".pliant/store")
# Measurement files, patterns for them or pandas frames, read together in their order, or what was read; None are those
# that the study names.
Data = Any


@dataclass(frozen=True)
class OpenStudy:
    """A study with the plugins and the store that its stages need."""

    study: Study
    bench: Workbench


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
        overrides: as after the command, ``["physics.kind=mujoco"]``.
        store: folder of finished stages.
        progress: told what happens; silent by default.

    Raises:
        UserError: the file is missing or wrong; the message lists every problem.
    """
    bench = workbench(store, progress)
    study = load_study(Path(path), bench.registry, overrides, progress.note if progress else warnings.warn)
    registry = with_files(bench.registry, study.plugins)
    return OpenStudy(study, replace(bench, registry=registry, store=ArtifactStore(Path(store), study.name)))


def workbench(store: str | Path = DEFAULT_STORE, progress: Progress | None = None) -> Workbench:
    """The installed plugins with a store, for what needs no study."""
    return Workbench(discover(), ArtifactStore(Path(store)), progress or Silent())


def sweep(opened: OpenStudy, executor: Workers = None, workers: int | None = None) -> SweepRun:
    """The FEM data of all designs of the study's `sweep`: `pliant fem`.

    Args:
        opened: the study.
        executor: any `concurrent.futures.Executor`, a dask client's `get_executor()` among them; or the address or
            the file of a dask scheduler.
        workers: processes of our own instead; 1 solves in this process. By default the study's, or one for each CPU.

    A script that starts processes needs `if __name__ == "__main__":`.
    """
    return sweep_study(opened.bench, opened.study, executor=executor, workers=workers)


@dataclass(frozen=True, eq=False)
class UnseenDesigns:
    """A study's meta-model in hand.

    Attributes:
        opened: the study.
        stage: the model with its scores, coverage and details.
    """

    opened: OpenStudy
    stage: MetaModelStage

    @property
    def scores(self) -> Mapping[str, Scores]:
        """Errors on designs left out: all, interior, border."""
        return self.stage.scores

    def law(self, parameters: Mapping[str, Any] | None = None) -> JointLaw:
        """The law of a design, with its error bar.

        Args:
            parameters: of the family, as a study writes them, ``{"average_radius": "7.2 mm"}``; the others are the
                study's.

        Raises:
            UserError: an impossible design, or one for which the model does not hold.
        """
        study = self.opened.study
        family = study.need("family", "a meta-model")
        try:
            changed = varied(family, parameters or {})
        except ValidationError as error:
            raise UserError(sentences(error, type(family), lambda path: "", ("family",))) from None
        self.opened.bench.build("family", changed)
        return self.stage.law(self.stage.values(changed, study.material))  # type: ignore[arg-type]

    def next(self, count: int = 1) -> list[Proposal]:
        """The designs that should be solved next, best first."""
        return designs_to_solve(self.opened.bench, self.opened.study, self.stage, count)


def meta_model(opened: OpenStudy) -> UnseenDesigns:
    """The study's meta-model, its designs solved first where they must be: `pliant fit`."""
    return UnseenDesigns(opened, meta_model_stage(opened.bench, opened.study))


def fem(opened: OpenStudy) -> tuple[Artifact, ...]:
    """The FEM data of each distinct design of the study: `pliant fem`."""
    opened.study.need("family", "FEM")
    check_study(opened.bench, opened.study)
    return fem_of_study(opened.bench, opened.study)


def laws(opened: OpenStudy) -> tuple[DesignStages, ...]:
    """Data and law of each distinct design of the study: `pliant fit`."""
    return laws_of_study(opened.bench, opened.study)


def simulate(opened: OpenStudy) -> StudyRun:
    """All stages up to the study's task: `pliant simulate`."""
    return simulate_study(opened.bench, opened.study)


def inverse(
    opened: OpenStudy,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    samples: int | None = None,
) -> InverseStatics:
    """Which actuations bring the robot where it should be: `solve` a target, follow a `path`, the `reachable` set.

    The task `reach` in a study does the same. The study's task gives its payload; effects of a chain are in place.

    Args:
        opened: the study; its engine has gradients, or differences of settled states stand for them.
        bounds: low and high of inputs in SI; by default the domain of the law.
        samples: equilibria of the reachable set to start from.

    Raises:
        UserError: a study without a chain, or an input without bounds.
    """
    chain = carried_chain(opened.bench, opened.study).chain
    physics = physics_of_study(opened.bench, opened.study)
    backend: PhysicsBackend = opened.bench.build("physics", physics)
    return InverseStatics(backend.build(chain), bounds, samples)


def optimize(opened: OpenStudy, executor: Workers = None, workers: int | None = None) -> SearchResult:
    """The study's search and the check of its winner: `pliant optimize`.

    Args:
        opened: the study; it has `search`.
        executor: any `concurrent.futures.Executor`, a dask client's `get_executor()` among them; or the address or
            the file of a dask scheduler.
        workers: processes of our own instead; 1 evaluates in this process. By default the study's, or one for each CPU.

    Raises:
        UserError: the study cannot be searched.
        NotReachedError: the executor broke. A search without a feasible candidate has an empty `best`.
    """
    result: SearchResult = search_study(opened.bench, opened.study, executor=executor, workers=workers).value
    return result


def read_measurement(opened: OpenStudy, data: Data = None) -> Measurement:
    """The study's measurements, or other files read by the same settings, as one measurement in their order."""
    if isinstance(data, Measurement):
        return data
    return measurement_of_study(opened.bench, opened.study, data)


def predictor(opened: OpenStudy, data: Data = None) -> Predictor:
    """The study's model, driven by the measured histories."""
    return Predictor.of_study(opened.bench, opened.study, read_measurement(opened, data))


def compare(opened: OpenStudy, data: Data = None) -> Comparison:
    """Model against measurements: `pliant compare`."""
    model = predictor(opened, data)
    return compare_model(model)[1]


def compare_counts(
    opened: OpenStudy, data: str | Path | None = None, *, workers: Workers = None
) -> CountComparison:
    """The study's task against a file of successes and trials: `pliant compare` on counts."""
    counted = counted_study(opened.study, None if data is None else Path(data))
    return compare_counted(opened.bench, counted, opened.study.who_works(workers, 1))


def diagnose(
    opened: OpenStudy, data: Data = None, *, kinds: Sequence[str] | None = None, workers: Workers = None
) -> Diagnosis:
    """Which physical effect is missing: `pliant diagnose`."""
    model = predictor(opened, data)
    own = own_runs(opened.study, model.chain, model.measurement)
    return diagnose_with(model, kinds=kinds, runs=own, workers=opened.study.who_works(workers, 1))


def extend(opened: OpenStudy, kinds: Sequence[str], data: Data = None) -> Extension:
    """Effects fitted on top of the study's own, with their uncertainty: `pliant extend`."""
    ground = Ground.of(opened.bench, opened.study, read_measurement(opened, data))
    return extend_with(ground, opened.study.effects, kinds)


def improve(
    opened: OpenStudy,
    data: Data = None,
    *,
    kinds: Sequence[str] | None = None,
    learned: bool = False,
    named_only: bool = False,
    workers: Workers = None,
) -> Improvement:
    """The whole loop, with runs put aside: `pliant improve`; `learned`: with a learned term as its last step."""
    measurement = read_measurement(opened, data)
    return improve_with(
        opened.bench,
        opened.study,
        measurement,
        kinds=kinds,
        learned=learned,
        named_only=named_only,
        workers=opened.study.who_works(workers, 1),
    )


def calibrate(
    opened: OpenStudy,
    data: str | Path,
    *,
    test: str | None = None,
    fit: Sequence[str] | None = None,
) -> Calibration:
    """Constants of the study's material from a tensile test or a free curve: `pliant calibrate`."""
    return calibrate_with(opened.bench, opened.study, read_bench_data(Path(data), test), fit)


def law_of_runs(opened: OpenStudy, data: Data = None, *, held: Sequence[str] = ()) -> LawOfRuns:
    """The coefficients of the study's stated law from measured runs, its effects in place."""
    return law_of_runs_with(opened.bench, opened.study, read_measurement(opened, data), held=held)
