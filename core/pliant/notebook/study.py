"""A study with methods named as the commands, each returning a `Result`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Self

from pliant import api
from pliant.config.overrides import as_overrides
from pliant.config.study import Study
from pliant.config.writing import StudyDraft
from pliant.diagnosis.bands import study_bands
from pliant.diagnosis.extension import Extension, write_extended_study
from pliant.diagnosis.learned_term import LearnedTerm
from pliant.errors import UserError
from pliant.evidence.compared import compare_model
from pliant.execution.executors import Workers
from pliant.formatting import displayed_in
from pliant.measurements.written_units import units_as_written
from pliant.notebook import frames
from pliant.notebook.result import Result, Simulated
from pliant.pipeline.reported_law import fitted_designs
from pliant.pipeline.segments import DesignStages
from pliant.pipeline.study import check_families, simulate_study, solve_study_fem
from pliant.records.law import JointLaw
from pliant.records.measurement import Measurement
from pliant.registry.data_kind import open_data
from pliant.registry.discovery import discover
from pliant.registry.function import package_function
from pliant.report.comparison import comparison_document
from pliant.report.diagnosis import diagnosis_document, leading
from pliant.report.document import Document
from pliant.report.extension import cited, extension_document
from pliant.report.extension import origin as extension_origin
from pliant.report.fem import fem_document
from pliant.report.fit import laws_document
from pliant.report.improvement import improvement_document, stands_for
from pliant.report.improvement import origin as improvement_origin
from pliant.report.plan import design_document, plan_document
from pliant.report.run import simulation_document
from pliant.report.system_picture import system_still

Data = Any  # a path, several, a pandas frame, or a result of `read`


class Solved(Result[Any]):
    """The FEM data of a module and the study that they belong to."""

    study: StudyHandle


class Fitted(Result[tuple[DesignStages, ...]]):
    """The laws of a study's distinct designs."""

    study: StudyHandle | None = None  # the study of these laws; a law of a bare table has none

    @property
    def law(self) -> JointLaw:
        """The law of the first design: `law.evaluate(actuation, deformation)` gives τ and its slopes.

        >>> pliant.open(examples / "data/bellow_bending.yaml", store=store).fit().law.axes
        ('y',)
        """
        return self.record[0].law.law


class StudyHandle:
    """An opened study; every method runs the command of its name and returns a `Result`.

    Finished stages are kept in the store, as by the commands.

    Attributes:
        path: the file that was read.
        opened: the study with its plugins and its store, for functions of `pliant.api`.
    """

    def __init__(self, path: Path, overrides: Sequence[str], opened: api.OpenStudy) -> None:
        self.path, self.opened = path, opened
        self._overrides = tuple(overrides)

    @classmethod
    def _from_opened(cls, path: Path, overrides: Sequence[str], opened: api.OpenStudy) -> Self:
        """Return a handle of a study that is open, also of a class that is composed otherwise."""
        handle = cls.__new__(cls)
        StudyHandle.__init__(handle, path, overrides, opened)
        return handle

    @property
    def config(self) -> Study:
        """The typed study."""
        return self.opened.study

    @property
    def name(self) -> str:
        """The study's name."""
        return self.config.name

    def __repr__(self) -> str:
        blocks = [
            key
            for key in type(self.config).model_fields
            if key not in ("pliant", "name") and getattr(self.config, key)
        ]
        return f"<study {self.name}: {', '.join(blocks)}>"

    def with_(self, changes: Mapping[str, Any] | None = None, /, **named: Any) -> Self:
        """Return the study with some keys changed: ``with_(pressure="20 kPa", physics="mujoco", chain={"modules":
        10})``.

        Args:
            changes: keys that are not Python names, such as ``{"chain.modules": 10}``.
            named: blocks, values, or names of keys that occur in one block only.

        Raises:
            UserError: an unknown or ambiguous key, or a value that is not allowed.

        >>> finger.with_(pressure="10 kPa", chain={"modules": 4}).simulate().markers.shape
        (6, 3)
        """
        overrides = [*self._overrides, *as_overrides(self.config, {**(changes or {}), **named})]
        context = self.opened.context
        opened = api.open_study(self.path, overrides, store=context.store.root, progress=context.progress)
        return type(self)._from_opened(self.path, overrides, opened)

    def to_yaml(self, path: str | Path) -> Path:
        """Write the study, with its changes, as a file that stands alone; return its path.

        Raises:
            UserError: the file would be the study itself or one of its bases, or cannot be written.

        >>> heavier = finger.with_({"chain.payload": "13 g"}).to_yaml(store / "heavier.yaml")
        >>> pliant.open(heavier, store=store).config.chain.modules
        8
        """
        target = Path(path)
        draft = StudyDraft(self.path, self._overrides)
        draft.write(target, self.config.canonical(), discover(), full=True)
        return target

    @property
    def law(self) -> JointLaw:
        """The law of the study's first design; it is solved and fitted if necessary.

        >>> finger.law.evaluate(np.array([15e3]), np.array([[0.0]])).tau.round(5)
        array([[0.02456]])
        """
        return api.laws(self.opened)[0].law.law

    def fem(self) -> Solved:
        """Return the FEM data of the study's first design: `pliant fem`. The record is a `ModuleData`.

        >>> coarse = {"pressures": 3, "angles": 3, "check_states": 2}
        >>> len(pliant.open(examples / "first_finger/finger.yaml", store=store, fem=coarse).fem().to_frame()) > 4
        True
        """
        check_families(self.opened.context, self.config)
        artifacts = solve_study_fem(self.opened.context, self.config)

        def document() -> Document:
            return fem_document(self.config, artifacts, [""] * len(artifacts))

        found = Solved(artifacts[0].value, document, ("fem_states", 1), frames.module_data)
        found.study = self
        return found

    def fit(self) -> Fitted:
        """Return the laws of the study's designs with their errors on held-out states: `pliant fit`.

        >>> pliant.open(examples / "data/bellow_bending.yaml", store=store).fit().law.joint
        'revolute'
        """
        context = self.opened.context
        stages = api.laws(self.opened)

        def document() -> Document:
            own = [stage for stage in stages if stage.law.report is not None]
            fitted = fitted_designs(context, own, learning=False)
            return laws_document(self.name, stages, fitted, self.config.canonical())

        found = Fitted(stages, document, ("fit_law", 0), frames.laws)
        found.study = self
        return found

    def simulate(self) -> Simulated:
        """Simulate the chain under the study's task in its engine: `pliant simulate`.

        >>> finger.simulate()
        <stated: 8-module finger bends 164.9° at 15 kPa; the law is stated by its coefficients.>
        """
        alone = self.with_(cross_check=[]) if self.config.cross_check else self
        return alone.run()

    def run(self) -> Simulated:
        """Run all stages, including `cross_check` engines: `pliant run`.

        >>> finger.with_(cross_check=["mujoco"]).run().to_frame()["engine"].unique().tolist()
        ['quasistatic', 'mujoco']
        """
        done = simulate_study(self.opened.context, self.config)
        return Simulated(done, lambda: simulation_document(done), ("chain_pose", 0), frames.markers)

    def compare(self, data: Data = None) -> Result[Any]:
        """Compare the model with the study's measurement or another: `pliant compare`. The record is a `Comparison`.

        >>> round(joint.compare().rmse_over_floor, 1)
        2.5
        """
        data = _recorded(data)
        other = None if isinstance(data, Measurement) else open_data(self.config, data)
        if other is not None:
            return Result(*other.compare(self.opened.context, self.config.resolve_workers(None, 1)))
        model = api.predictor(self.opened, data)
        with displayed_in(units_as_written(model.measurement)):
            predicted, found = compare_model(model)

        def document() -> Document:
            with displayed_in(units_as_written(model.measurement)):
                bands = study_bands(self.opened.context, self.config, model.measurement)
                return comparison_document(self.name, model.measurement, predicted, found, *bands)

        return Result(
            found,
            document,
            ("runs", 0),
            lambda _: frames.residuals(model.measurement, predicted),
            lambda: system_still(model, [effect.kind for effect in self.config.effects]),
        )

    def diagnose(
        self, data: Data = None, *, effects: Sequence[str] | None = None, workers: Workers = None
    ) -> Result[Any]:
        """Diagnose which physical effect is missing: `pliant diagnose`. The record is a `Diagnosis`.

        >>> joint.diagnose(effects=["viscoelastic", "stiffness"]).verdict
        'missing_effect'
        """
        measurement = api.read_measurement(self.opened, _recorded(data))
        registry = self.opened.context.registry
        with displayed_in(units_as_written(measurement)):
            found = api.diagnose(self.opened, measurement, kinds=effects, workers=workers)

        def document() -> Document:
            with displayed_in(units_as_written(measurement)):
                return diagnosis_document(self.name, measurement, found, registry, asked=effects or ())

        def still() -> bytes | None:
            return system_still(api.predictor(self.opened, measurement), leading(found))

        return Result(found, document, ("hypotheses", 0), frames.hypotheses, still)

    def plan(
        self,
        data: Data = None,
        *,
        effects: Sequence[str] | None = None,
        runs: int | None = None,
        minutes: float | None = None,
        workers: Workers = None,
    ) -> Result[Any]:
        """Choose the next runs: `pliant plan`. The record is a `RunPlan`, without measurements a `FirstRuns`.

        Args:
            data: see `compare`.
            effects: candidates; all by default.
            runs: number of runs at most.
            minutes: bench time at most.
            workers: processes that fit hypotheses; by default the study's, or this one.

        >>> joint.plan(effects=["viscoelastic", "stiffness"]).json["verdict"]
        'missing_effect'
        """
        registry = self.opened.context.registry
        if data is None and self.config.measurements is None:
            first = api.plan_first_runs(self.opened, kinds=effects, runs=runs, minutes=minutes)
            return Result(first, lambda: design_document(self.name, first.design, (), registry), ("runs", 0))
        measurement = api.read_measurement(self.opened, _recorded(data))
        with displayed_in(units_as_written(measurement)):
            found = api.plan(
                self.opened, measurement, kinds=effects, runs=runs, minutes=minutes, workers=workers
            )

        def document() -> Document:
            with displayed_in(units_as_written(measurement)):
                return plan_document(self.name, measurement, found, (), registry)

        return Result(found, document, ("runs", 0))

    def extend(self, *effects: str, data: Data = None, out: str | Path | None = None) -> Result[Any]:
        """Fit effects in addition to the study's own: `pliant extend`. The record is an `Extension`.

        Args:
            effects: kinds to fit.
            data: see `compare`.
            out: a new study file with them; nothing is written if the runs show none of them.

        >>> [effect.kind for effect in joint.extend("viscoelastic").effects]
        ['viscoelastic']
        """
        files = [] if out is None else _data_files(data)
        measurement = api.read_measurement(self.opened, _recorded(data))
        with displayed_in(units_as_written(measurement)):
            found = api.extend(self.opened, effects, measurement)

        def document() -> Document:
            with displayed_in(units_as_written(measurement)):
                return extension_document(self.name, measurement, found, self.opened.context.registry)

        if out is not None and not found.absent:
            self._write(Path(out), found, files, extension_origin(found, measurement), {})
        return Result(found, document)

    def improve(
        self,
        data: Data = None,
        *,
        effects: Sequence[str] | None = None,
        learned: bool = False,
        named_only: bool = False,
        workers: Workers = None,
        out: str | Path | None = None,
    ) -> Result[Any]:
        """Compare, diagnose, extend until the noise floor: `pliant improve`. The record is an `Improvement`.

        Args:
            data: see `compare`.
            effects: candidates; all by default.
            learned: whether a learned term may be the last step.
            named_only: add only effects that a verdict names, however well others predict.
            workers: processes that fit hypotheses; by default the study's, or this one.
            out: a new study file with what was added; nothing is written if nothing was added.

        >>> joint.improve(effects=["viscoelastic", "stiffness"]).to_frame()["added"].tolist()
        ['the model as it was', 'viscoelastic']
        """
        files = [] if out is None else _data_files(data)
        measurement = api.read_measurement(self.opened, _recorded(data))
        registry = self.opened.context.registry
        with displayed_in(units_as_written(measurement)):
            found = api.improve(
                self.opened,
                measurement,
                kinds=effects,
                learned=learned,
                named_only=named_only,
                workers=workers,
            )

        def document() -> Document:
            with displayed_in(units_as_written(measurement)):
                return improvement_document(self.name, measurement, found, registry, effects or ())

        if out is not None and (found.final is not None or found.learned is not None):
            notes = {kind: stands_for(step) for step in found.steps for kind in step.added}
            note = improvement_origin(found, cited(measurement))
            self._write(Path(out), found.final, files, note, notes, found.learned)

        def still() -> bytes | None:
            kinds = [effect.kind for effect in found.steps[-1].effects]
            return system_still(api.predictor(self.opened, measurement), kinds)

        return Result(found, document, ("steps", 0), frames.steps, still)

    def _write(
        self,
        target: Path,
        extension: Extension | None,
        files: list[Path],
        note: str,
        notes: Mapping[str, str],
        learned: LearnedTerm | None = None,
    ) -> None:
        """Write the study with the effects of an extension, as the commands do."""
        write_extended_study(
            self.path,
            target,
            self.config,
            self._overrides,
            extension,
            note,
            discover(),
            notes_by_kind=notes,
            learned=learned,
            data=files,
        )

    def optimize(self, workers: int | None = None) -> Result[Any]:
        """Run the study's search and check the best design: `pliant optimize`. The record is a `SearchResult`.

        >>> search = pliant.open(examples / "shape_matching/small.yaml", store=store)
        >>> search.with_({"search.budget": 2}).optimize(workers=1).evaluations > 0
        True
        """
        result: Result[Any] = package_function("optimize", "pliant_search")(self.opened, workers=workers)
        return result

    def calibrate(
        self, data: str | Path, *, test: str | None = None, fit: Sequence[str] | None = None
    ) -> Result[Any]:
        """Fit constants of the study's material to a test: `pliant calibrate`. The record is a `Calibration`.

        Args:
            data: the file of the test.
            test: kind of the test; by default that of the file's columns.
            fit: constants to fit; all by default.

        >>> silicone = pliant.open(examples / "materials/silicone.yaml", store=store)
        >>> silicone.calibrate(examples / "materials/pull.csv")
        <silicone: ...>
        """
        found = api.calibrate(self.opened, data, test=test, fit=fit)
        document = package_function("calibration_document", "pliant_calibrate")
        return Result(found, lambda: document(self.name, found))


def _data_files(data: Data) -> list[Path]:
    """Return the files that a new study names, those of the data; empty for the study's own.

    Raises:
        UserError: data that are not files, or that are readable only with notes given in Python.
    """
    if isinstance(data, Result):
        block = data.json.get("measurements", {})
        data = block["file"] if set(block) == {"file"} else data
    if isinstance(data, str | Path):
        return [Path(data)]
    files = [] if data is None else data
    if isinstance(files, list | tuple) and all(isinstance(file, str | Path) for file in files):
        return [Path(file) for file in files]
    raise UserError(
        "a new study names its measurement's files, which must be readable as they are; give 'data' as paths, with "
        "notes in a YAML file beside each, or leave 'out' out."
    )


def _recorded(data: Data) -> Data:
    """Return the measurement of a result of `read`; other data unchanged."""
    return data.record if isinstance(data, Result) else data
