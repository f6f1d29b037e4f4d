"""A study with methods: the commands in the same words, each giving a `Result`."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pliant import api
from pliant.config.overrides import as_overrides
from pliant.config.study import Study
from pliant.diagnosis.bands import study_bands
from pliant.diagnosis.extension import Extension, write_extended_study
from pliant.diagnosis.learned_term import LearnedTerm
from pliant.errors import UserError
from pliant.evidence.compared import compare_model
from pliant.evidence.counts import CountComparison, counted_study, is_counted
from pliant.execution.executors import Workers
from pliant.formatting import displayed_in
from pliant.measurements.written_units import units_as_written
from pliant.notebook import frames
from pliant.notebook.result import Fitted, Result, Simulated
from pliant.pipeline.study import law_of_table, physics_of_study
from pliant.records.law import JointLaw
from pliant.records.measurement import Measurement
from pliant.registry.discovery import discover
from pliant.report import plots
from pliant.report.calibration import calibration_document
from pliant.report.comparison import comparison_document
from pliant.report.counts import counts_document
from pliant.report.diagnosis import diagnosis_document
from pliant.report.extension import cited, extension_document
from pliant.report.extension import origin as extension_origin
from pliant.report.fem import fem_document
from pliant.report.fit import fitted_designs, fitted_law, laws_document, table_document
from pliant.report.improvement import improvement_document, stands_for
from pliant.report.improvement import origin as improvement_origin
from pliant.report.run import simulation_document
from pliant.report.search import search_document
from pliant.store.store import write_atomically

Data = Any  # a path, several, a pandas frame, or what `read` gave


class StudyHandle:
    """A study in hand; every method is the command of its name and gives a `Result`.

    Finished stages are kept in the store, as those of the commands are.

    Attributes:
        path: the file that was read.
        opened: the study with its plugins and its store, for functions of `pliant.api`.
    """

    def __init__(self, path: Path, overrides: Sequence[str], opened: api.OpenStudy) -> None:
        self.path, self.opened = path, opened
        self._overrides = tuple(overrides)

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
            key for key in Study.model_fields if key not in ("pliant", "name") and getattr(self.config, key)
        ]
        return f"<study {self.name}: {', '.join(blocks)}>"

    def with_(self, changes: Mapping[str, Any] | None = None, /, **named: Any) -> StudyHandle:
        """The study with some keys changed: ``with_(pressure="20 kPa", physics="mujoco", chain={"modules": 10})``.

        Args:
            changes: keys that are no Python names, such as ``{"chain.modules": 10}``.
            named: blocks, values, or names of keys that stand in one block alone.

        Raises:
            UserError: an unknown or ambiguous key, or a value that is not allowed.

        >>> finger.with_(pressure="10 kPa", chain={"modules": 4}).simulate().markers.shape
        (6, 3)
        """
        overrides = [*self._overrides, *as_overrides(self.config, {**(changes or {}), **named})]
        bench = self.opened.bench
        opened = api.open_study(self.path, overrides, store=bench.store.root, progress=bench.progress)
        return StudyHandle(self.path, overrides, opened)

    @property
    def law(self) -> JointLaw:
        """The law of the study's first design, solved and fitted first where it must be.

        >>> finger.law.evaluate(np.array([15e3]), np.array([[0.0]])).tau.round(5)
        array([[0.02456]])
        """
        return api.laws(self.opened)[0].law.law

    def fem(self) -> Result[Any]:
        """The FEM data of the study's first design: `pliant fem`. The record is a `ModuleData`.

        >>> coarse = {"pressures": 3, "angles": 3, "check_states": 2}
        >>> len(pliant.open(examples / "first_finger/finger.yaml", store=store, fem=coarse).fem().to_frame()) > 4
        True
        """
        artifacts = api.fem(self.opened)
        document = fem_document(self.config, artifacts, [""] * len(artifacts))
        return Result(artifacts[0].value, document, plots.module_data, frames.module_data)

    def fit(self) -> Fitted:
        """The laws of the study's designs with their errors on states left out: `pliant fit`.

        >>> pliant.open(examples / "data/bellow_bending.yaml", store=store).fit().law.joint
        'revolute'
        """
        bench = self.opened.bench
        stages = api.laws(self.opened)
        fitted = fitted_designs(bench, [s for s in stages if s.law.report is not None], learning=False)
        document = laws_document(self.name, stages, fitted, self.config.canonical())
        return Fitted(stages, document, plots.laws, frames.laws)

    def simulate(self) -> Simulated:
        """The chain under the study's task in its engine: `pliant simulate`.

        >>> finger.simulate()
        <stated: 8-module finger bends 164.9° at 15 kPa; the law is stated by its coefficients.>
        """
        alone = self.with_(cross_check=[]) if self.config.cross_check else self
        return alone.run()

    def run(self) -> Simulated:
        """All stages, `cross_check` engines too: `pliant run`.

        >>> finger.with_(cross_check=["mujoco"]).run().to_frame()["engine"].unique().tolist()
        ['quasistatic', 'mujoco']
        """
        done = api.simulate(self.opened)
        return Simulated(done, simulation_document(done), plots.backbones, frames.markers)

    def compare(self, data: Data = None) -> Result[Any]:
        """The model against the study's measurement or another: `pliant compare`. The record is a `Comparison`.

        >>> round(joint.compare().rmse_over_floor, 1)
        2.5
        """
        data = _recorded(data)
        if not isinstance(data, Measurement) and is_counted(self.config, data):
            counted = counted_study(self.config, data)
            counts: CountComparison = api.compare_counts(self.opened, data)
            return Result(counts, counts_document(self.name, counted.counts, counts))
        model = api.predictor(self.opened, data)
        with displayed_in(units_as_written(model.measurement)):
            predicted, found = compare_model(model)
            bands = study_bands(self.opened.bench, self.config, model.measurement)
            document = comparison_document(self.name, model.measurement, predicted, found, *bands)
        return Result(
            found,
            document,
            lambda _, ax: plots.measured(model.measurement, predicted, ax),
            lambda _: frames.residuals(model.measurement, predicted),
        )

    def diagnose(
        self, data: Data = None, *, effects: Sequence[str] | None = None, workers: Workers = None
    ) -> Result[Any]:
        """Which physical effect is missing: `pliant diagnose`. The record is a `Diagnosis`.

        >>> joint.diagnose(effects=["viscoelastic", "stiffness"]).verdict
        'missing_effect'
        """
        measurement = api.read_measurement(self.opened, _recorded(data))
        registry = self.opened.bench.registry
        with displayed_in(units_as_written(measurement)):
            found = api.diagnose(self.opened, measurement, kinds=effects, workers=workers)
            document = diagnosis_document(self.name, measurement, found, registry, asked=effects or ())
        return Result(found, document, plots.hypotheses, frames.hypotheses)

    def extend(self, *effects: str, data: Data = None, out: str | Path | None = None) -> Result[Any]:
        """Effects fitted on top of the study's own: `pliant extend`. The record is an `Extension`.

        Args:
            effects: kinds to fit.
            data: see `compare`.
            out: a new study file that has them; nothing is written where the runs show none of them.

        >>> [effect.kind for effect in joint.extend("viscoelastic").effects]
        ['viscoelastic']
        """
        files = [] if out is None else _files_of(data)
        measurement = api.read_measurement(self.opened, _recorded(data))
        with displayed_in(units_as_written(measurement)):
            found = api.extend(self.opened, effects, measurement)
            document = extension_document(self.name, measurement, found, self.opened.bench.registry)
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
            named_only: add nothing whose cause no verdict names, however well it predicts.
            workers: processes that fit hypotheses; by default the study's, or this one.
            out: a new study file that has what was added; nothing is written where nothing was.

        >>> joint.improve(effects=["viscoelastic", "stiffness"]).to_frame()["added"].tolist()
        ['the model as it was', 'viscoelastic']
        """
        files = [] if out is None else _files_of(data)
        measurement = api.read_measurement(self.opened, _recorded(data))
        registry = self.opened.bench.registry
        with displayed_in(units_as_written(measurement)):
            found = api.improve(
                self.opened,
                measurement,
                kinds=effects,
                learned=learned,
                named_only=named_only,
                workers=workers,
            )
            document = improvement_document(self.name, measurement, found, registry, effects or ())
        if out is not None and (found.final is not None or found.learned is not None):
            notes = {kind: stands_for(step) for step in found.steps for kind in step.added}
            note = improvement_origin(found, cited(measurement))
            self._write(Path(out), found.final, files, note, notes, found.learned)
        return Result(found, document, plots.steps, frames.steps)

    def _write(
        self,
        target: Path,
        found: Extension | None,
        files: list[Path],
        note: str,
        notes: Mapping[str, str],
        learned: LearnedTerm | None = None,
    ) -> None:
        """The study with the effects of an extension, as the commands write it."""
        write_extended_study(
            self.path,
            target,
            self.config,
            self._overrides,
            found,
            note,
            discover(),
            notes_by_kind=notes,
            learned=learned,
            data=files,
        )

    def optimize(self, workers: int | None = None) -> Result[Any]:
        """The study's search and the check of its winner: `pliant optimize`. The record is a `SearchResult`.

        >>> search = pliant.open(examples / "shape_matching/small.yaml", store=store)
        >>> search.with_({"search.budget": 2}).optimize(workers=1).evaluations > 0
        True
        """
        found = api.optimize(self.opened, workers=workers)
        engine = physics_of_study(self.opened.bench, self.config).kind
        document = search_document(self.config.canonical(), found, engine=engine)
        return Result(found, document, plots.history, frames.history)

    def calibrate(self, data: str | Path, **options: Any) -> Result[Any]:
        """Constants of the study's material from a test: `pliant calibrate`. The record is a `Calibration`.

        >>> silicone = pliant.open(examples / "materials/silicone.yaml", store=store)
        >>> silicone.calibrate(examples / "materials/pull.csv")
        <silicone: ...>
        """
        found = api.calibrate(self.opened, data, **options)
        return Result(found, calibration_document(self.name, found))


def _files_of(data: Data) -> list[Path]:
    """The files that a new study names: those of the data, or that `read` read without notes; none for the study's own.

    Raises:
        UserError: data that are no files, or that only notes in Python make readable.
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
    """What `read` gave as the measurement that it holds; other data as they are."""
    return data.record if isinstance(data, Result) else data


def open_study(path: str | Path, *, store: str | Path = api.DEFAULT_STORE, **changes: Any) -> StudyHandle:
    """Read a study file; `changes` as in `StudyHandle.with_`.

    Raises:
        UserError: the file is missing or wrong; the message lists every problem.

    >>> pliant.open(examples / "helix/helix.yaml", store=store, physics="mujoco")
    <study helix: surrogate, chain, physics, cross_check, task>
    """
    handle = StudyHandle(Path(path), (), api.open_study(path, store=store))
    return handle.with_(changes) if changes else handle


def read(files: Any, **notes: Any) -> Result[Measurement]:
    """Measurement files, or a pandas frame, as the commands read them.

    Args:
        files: a path, several, a pattern such as ``"runs/*.csv"``, or a pandas frame.
        notes: what the files do not say of themselves: ``rename={"bend": "angle_rad"}``, ``units={"p": "mbar"}``.

    Raises:
        UserError: what cannot be read, or cannot be decided without being asked.

    >>> pliant.read(examples / "hidden_effect/bench.csv").to_frame()["run"].nunique()
    14
    """
    measurement, document = api.read(files, notes)
    return Result(measurement, document, plots.readings, frames.readings)


def fit(
    table: Any, surrogate: str = "polynomial", *, store: str | Path = api.DEFAULT_STORE, **settings: Any
) -> Fitted:
    """A joint law from a table of anybody's, with its errors on states left out: `pliant fit TABLE`.

    Args:
        table: a path (docs/bring_your_own_data.md), or a pandas frame with the same columns.
        surrogate: the kind of law.
        store: folder of finished stages.
        settings: keys of the surrogate's block.

    Raises:
        UserError: what is wrong with the table, by line, or a key that the surrogate does not have.

    >>> pliant.fit(examples / "data/bellow_bending.csv", store=store).law.joint
    'revolute'
    """
    bench = api.workbench(store)
    source = Path(table) if isinstance(table, str | Path) else _kept(table, Path(store))
    stages = law_of_table(bench, source, surrogate, settings)
    config: Any = stages.design.surrogate
    fitted = fitted_law(bench, surrogate, config, stages.law, learning=False, source=source.name)
    return Fitted((stages,), table_document(source, stages, [fitted], {}), plots.laws, frames.laws)


def _kept(frame: Any, store: Path) -> Path:
    """A frame as a CSV in the store, where the law's study finds it again."""
    text = frame.to_csv(index=False)
    path = store / "tables" / f"{hashlib.sha256(text.encode()).hexdigest()[:16]}.csv"
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, text)
    return path.resolve()
