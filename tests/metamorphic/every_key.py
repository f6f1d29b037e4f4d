"""Vary every number and choice of a study, and compare the answers of each verb."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin
from unittest.mock import patch

import numpy as np
from pydantic import ValidationError
from tests.pipeline.analytic import Analytic, Potential, power, sine

from pliant.config.study import Study, written_name
from pliant.config.study_keys import KeyPath
from pliant.errors import InvalidDesignError, PliantError
from pliant.evidence.prediction import Predictor
from pliant.execution.progress import Silent
from pliant.interfaces.base import FrozenModel
from pliant.pipeline.dataset import build_piece, module_problems
from pliant.pipeline.sampling.plan import sample
from pliant.pipeline.sampling.strategies import axis_loads
from pliant.pipeline.sampling.walk import FULL, MAIN, Subproblem
from pliant.pipeline.sensitivities import changed
from pliant.pipeline.simulate import drawn_chains, run_task, spread
from pliant.pipeline.study import (
    build_study_chain,
    build_study_laws,
    check_study,
    load_remarks,
    study_physics,
    unused_blocks,
)
from pliant.pipeline.visual import seen_surface
from pliant.pipeline.workbench import RunContext
from pliant.records.fem import FemState
from pliant.records.law import JointLaw
from pliant.records.measurement import Measurement
from pliant.testing.box import box_problem
from pliant_designs.sweep_designs import sweep_designs
from pliant_search.evaluate.fast_path import FastPath
from pliant_search.records import SearchResult
from pliant_search.stage import search_study

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
STATED = {
    "kind": "polynomial",
    "form": "study",
    "coefficients": {"k_n": 1.6e-6, "m_a": -1.7e-6, "m_e": 0.1, "b_e": 0.0245},
}
SHORT = 400  # of a refusal, in characters
WITH_UNIT = re.compile(r"(-?\d+(?:\.\d+)?(?:e-?\d+)?)( .*)?")


@dataclass(frozen=True)
class Perturbed:
    """A key with values that may replace its value, mild ones first.

    Attributes:
        path: from the study down, fields by their names.
        written: as a study writes it.
        values: to be tried one after another until the answer changes.
        stated: whether the study states it.
    """

    path: KeyPath
    written: str
    values: tuple[Any, ...]
    stated: bool

    def named_in(self, words: Iterable[str]) -> bool:
        """Return whether a sentence names the key, or a list of unused keys contains it or its block."""
        dotted = f"{self.path[0]}.{self.written}"
        return any(word in (self.path[0], dotted) or f"{dotted}" in word for word in words)


class Heard(Silent):
    """A progress that keeps its notes."""

    def __init__(self) -> None:
        self.notes: set[str] = set()

    def note(self, text: str) -> None:
        self.notes.add(text)


def perturbed_keys(
    node: Any, path: KeyPath = (), written: str = "", annotation: Any = None, stated: bool = True
) -> Iterator[Perturbed]:
    """Yield every number, truth and choice of a study, without texts and absent values."""
    if isinstance(node, FrozenModel):
        for name, info in type(node).model_fields.items():
            if name != "kind":
                word, given = written_name(type(node), name), stated and name in node.model_fields_set
                yield from perturbed_keys(getattr(node, name), (*path, name), word, info.annotation, given)
    elif isinstance(node, Mapping):
        for name, value in node.items():
            yield from perturbed_keys(value, (*path, name), str(name), None, stated)
    elif isinstance(node, list | tuple) and node and all(isinstance(one, float) for one in node):
        # A vector is one key: a force along a joint's axis moves nothing, another direction does.
        changes = [(k, other) for k, one in enumerate(node) for other in (one * 1.03, one / 1.03, one + 0.3)]
        values = tuple((*node[:k], other, *node[k + 1 :]) for k, other in changes if other != node[k])
        yield Perturbed(path, written, values, stated)
    elif isinstance(node, list | tuple):
        for index, value in enumerate(node):
            yield from perturbed_keys(value, (*path, index), written, None, stated)
    elif values := tuple(_others(node, annotation)):
        yield Perturbed(path, written, values, stated)


def _others(value: Any, annotation: Any) -> Iterator[Any]:
    """Yield other values of a number, a truth or a choice."""
    choices = [one for arm in _arms(annotation) if get_origin(arm) is Literal for one in get_args(arm)]
    if isinstance(value, bool):
        yield not value
    elif isinstance(value, int):
        yield from (other for other in (value + 1, value - 1, 1, 2, 3 * value + 5) if other != value)
    elif isinstance(value, float):
        yield from (
            (value * 1.03, value / 1.03, value * 30.0, value / 30.0, 1e4 * value) if value else (0.03, 1e-3)
        )
    elif isinstance(value, str) and value in choices:
        yield from (one for one in choices if one != value)
    elif isinstance(value, str) and (match := WITH_UNIT.fullmatch(value)):
        number, unit = float(match[1]), match[2] or ""
        yield from (f"{number * 1.03 or 0.5:g}{unit}", f"{number / 1.03:g}{unit}")


def silent_keys(
    study: Study, heads: Collection[str], answer: Callable[[Study], tuple[Any, ...]]
) -> Iterator[Perturbed]:
    """Yield the keys of these blocks with no value that changes the answer, is refused, or is named in it.

    An answer is the result, then the sentences printed, then the keys called unused.
    """
    plain = answer(study)
    assert len(plain[0]) > SHORT, plain[0]  # a refusal would be the answer to every key
    for key in perturbed_keys(study):
        if key.path[0] not in heads or key.named_in([*plain[1], *plain[2]]):
            continue
        for value in key.values:
            try:
                other = changed(study, key.path, value)
            except (ValidationError, PliantError):
                continue
            there = answer(other)
            if there != plain or key.named_in([*there[1], *there[2]]):
                break
        else:
            if all(_refused(study, key, value) for value in key.values):
                continue
            yield key


def _refused(study: Study, key: Perturbed, value: Any) -> bool:
    try:
        changed(study, key.path, value)
    except (ValidationError, PliantError):
        return True
    return False


def _arms(annotation: Any) -> Iterator[Any]:
    origin = get_origin(annotation)
    if origin is Annotated:
        yield from _arms(get_args(annotation)[0])
    elif origin in (Union, UnionType):
        for arm in get_args(annotation):
            yield from _arms(arm)
    else:
        yield annotation


def simulated(study: Study, context: RunContext) -> tuple[Any, ...]:
    """Return the result of a simulation: law, body, metrics and poses in every engine and with drawn laws, and notes.

    For a study without a task the answer is its laws and its chain.
    """
    heard = Heard()
    context = replace(context, progress=heard)
    try:
        designs = build_study_laws(context, study)
        unused = unused_blocks(study, [stage.fem is not None for stage in designs])
        laws = [_law(stages.law.law) for stages in designs]
        looks = [seen_surface(context.build("family", s.design.family)) for s in designs if s.design.family]
        shapes = [repr([part.vertices_m.sum(axis=0) for part in look.parts]) for look in looks]
        if study.chain is None:
            return repr((laws, shapes)), heard.notes, unused
        chain = build_study_chain(context, study, mounted=True).chain
        body = repr((sum(one.mass_kg for one in chain.bodies), chain.length_m, chain.shapes, laws, shapes))
        if study.task is None:
            return body, heard.notes, unused
        task, effects = (
            context.build("task", study.noisy_task()),
            [context.build("effect", e) for e in study.effects],
        )
        engines = [
            context.build("physics", one) for one in (study_physics(context, study), *study.cross_check)
        ]
        results = [run_task(engine, task, effects, chain) for engine in engines]
        drawn: Any = None
        if study.uncertainty is not None:
            chains = drawn_chains(chain, study.uncertainty.samples, study.uncertainty.seed)
            drawn = spread(
                [run_task(engines[0], task, effects, one) for one in chains], study.uncertainty.level
            )
    except PliantError as error:
        return str(error), set(), []
    found = [
        (sorted(one.metrics.items()), one.final.markers_m.tolist(), one.final.converged) for one in results
    ]
    heard.notes |= set(load_remarks(chain, study.noisy_task()))
    return repr((body, found, drawn)), heard.notes, unused


def compared(study: Study, context: RunContext, measurement: Measurement) -> tuple[Any, ...]:
    """Return the result of a comparison with a recording: the readings of the model in every run."""
    try:
        predictor = Predictor.from_study(context, study, measurement)
        runs = predictor.predict(study.effects)
    except PliantError as error:
        return str(error), set(), []
    found = [{name: values.tobytes() for name, values in run.items()} for run in runs]
    return repr((found, predictor.law_error)), set(predictor.remarks), []


def solved(study: Study, context: RunContext) -> tuple[Any, ...]:
    """Return the input and a result of FEM: meshes and supports, the material's response, the states, one solved state.

    States are chosen on a potential in closed form in the place of the solver, which solves one state of a small box.
    """
    heard = Heard()
    try:
        check_study(context, study)
        fem, material = study.need("fem", "FEM"), study.need("material", "FEM")
        substance, backend = context.build("material", material), context.build("fem", fem)
        parts: list[Any] = [_response(substance), _solved_box(backend, substance)]
        if study.sweep is not None:
            parts += [(one.family.canonical(), one.material.canonical()) for one in sweep_designs(study)]
        for family in _designs(study):
            try:
                parts += _asked(study, context.build("family", family), heard)
            except InvalidDesignError as error:  # a sweep skips it
                parts.append(str(error))
    except PliantError as error:
        return str(error), set(), []
    return repr(parts), heard.notes, []


def _asked(study: Study, built: Any, heard: Heard) -> list[Any]:
    """Return the problems of a family, its mass, and the chosen states."""
    fem, density = study.need("fem", "FEM"), study.need("material", "FEM").density_kg_m3
    problems = module_problems(built, fem.refinement)
    main = problems[MAIN]
    limit = fem.actuation_max(main.actuation)
    loads = axis_loads(fem, problems.get(FULL, main)) if fem.sampling == "study" else {}
    with TemporaryDirectory() as folder:
        found = sample(_pieces(problems, limit), fem, limit, Path(folder), heard, loads)
    states = [(repr(one.target), one.state.actuation, one.state.deformation.tolist()) for one in found.solved]
    return [*(_plain(one) for one in problems.values()), _plain(built.mass(density)), *states]


def _designs(study: Study) -> list[Any]:
    """Return the families that FEM solves; the first, the middle and the last design of a sweep."""
    if study.sweep is None:
        return [study.family]
    swept = sweep_designs(study)
    return [swept[k].family for k in sorted({0, len(swept) // 2, len(swept) - 1})]


class _SeveralInputs(Analytic):
    """A potential that is driven by the weighted sum of several actuations."""

    def __init__(self, count: int, *driven: Any) -> None:
        super().__init__(*driven)
        self.weights = 1.0 - 0.7 * np.arange(count)

    def rest(self) -> FemState:
        return self._spread(super().rest(), np.zeros_like(self.weights))

    def free(self, actuation: Any, start: FemState) -> FemState:
        levels = np.asarray(actuation, float)
        return self._spread(super().free(float(self.weights @ levels), start), levels)

    def constrained(self, actuation: Any, held: Any, start: FemState) -> FemState:
        levels = np.asarray(actuation, float)
        return self._spread(super().constrained(float(self.weights @ levels), held, start), levels)

    def _spread(self, state: FemState, levels: np.ndarray) -> FemState:
        """Return the state of the sum as a state of the actuations."""
        by_level = np.outer(state.dtau_dp, self.weights)
        return replace(state, actuation=levels, dtau_dp=by_level, travel=np.zeros(len(levels)))


def _pieces(problems: Mapping[str, Any], limit: Any) -> list[Subproblem]:
    """Return the pieces with a potential in the place of a solver, stiffer about the axes that nothing drives."""
    pieces = []
    for name, one in problems.items():
        top = float(np.max(list(limit.values()) if isinstance(limit, Mapping) else limit))
        count, rest = len(one.axes), power(0)
        terms = [(-0.6 / top, (power(1), *(sine(0.9) if a == one.main_axis else rest for a in one.axes)))]
        for axis in range(count):
            for degree, stiffness in ((2, 0.5 + 0.1 * axis), (4, 0.2)):
                functions = [power(degree) if k == axis else rest for k in range(count)]
                terms.append((stiffness, (rest, *functions)))
        driven = (Potential(*terms), one.axes, one.main_axis)
        solver = _SeveralInputs(np.size(limit), *driven) if np.ndim(limit) else Analytic(*driven)
        pieces.append(build_piece(name, one, solver))
    return pieces


def _response(substance: Any) -> Any:
    """Return the stress of a material in two deformations, its moduli and its density."""
    F = np.eye(3) + np.array(
        [[[0.1, 0.05, 0], [0, -0.03, 0], [0.02, 0, -0.04]], [[0.4, 0, 0], [0, -0.1, 0], [0, 0, -0.2]]]
    )
    return repr(substance.evaluate(F)), substance.config.density_kg_m3


def _solved_box(backend: Any, substance: Any) -> Any:
    """Return the state of the box under pressure, with the solver's iterations."""
    state = backend.checked_solver(box_problem(), substance).free(
        2e3, backend.checked_solver(box_problem(), substance).rest()
    )
    return state.deformation.tolist(), state.energy_j, state.iterations, state.dtau_du.tolist()


def _plain(value: Any) -> Any:
    """Return a problem as plain values that repr distinguishes: arrays by a digest of their bytes."""
    if isinstance(value, np.ndarray):
        return hashlib.sha256(value.tobytes()).hexdigest()
    if is_dataclass(value):
        return [(f.name, _plain(getattr(value, f.name))) for f in fields(value)]
    if isinstance(value, Mapping):
        return [(name, _plain(item)) for name, item in value.items()]
    return [_plain(one) for one in value] if isinstance(value, list | tuple) else value


def searched(study: Study, context: RunContext) -> tuple[Any, ...]:
    """Return the result of a search in which a candidate's metrics are drawn from its study alone.

    The check of the winner is left out.
    """
    heard = Heard()
    context = replace(context, progress=heard)
    config = study.need("search", "a search")
    law = context.registry.get("surrogate", "polynomial").config_model().model_validate(STATED)
    alone = {"search": config.model_copy(update={"verify": None}), "meta_model": None, "surrogate": law}
    study = study.model_copy(update=alone)
    try:
        with patch.object(FastPath, "result", _drawn):
            found: SearchResult = search_study(context, study, workers=1).value
    except PliantError as error:
        return str(error), set(), []
    history = found.history
    told = [
        (name, _plain(getattr(history, name))) for name in ("values", "objectives") if hasattr(history, name)
    ]
    best = [(one.values, one.objectives) for one in found.best]
    rest = (found.objectives, found.branches, found.slopes, found.limits, found.evaluations, found.robustness)
    folders = sorted({Path(name).parent.as_posix() for name in found.files})
    return repr((told, best, rest, folders)), heard.notes, []


def _drawn(path: FastPath, study: Study, law: Any = None) -> Any:
    """Return metrics of a candidate, drawn from a seed that is its study's content."""
    told = study.model_dump(mode="json", exclude={"search", "optimizer", "name"})
    digest = hashlib.sha256(json.dumps([told, repr(law)], sort_keys=True, default=str).encode()).digest()
    numbers = np.random.default_rng(int.from_bytes(digest[:8], "big")).random(4).tolist()
    metrics = dict(zip(("rmse_m", "e_max_m", "reward", "success_share"), numbers, strict=True))
    final = SimpleNamespace(converged=True, outside_domain=())
    return SimpleNamespace(metrics=metrics, final=final, not_reached="")


def _law(law: JointLaw) -> Any:
    """Return efforts of a law on both sides of rest, and its domain."""
    names, low_high = len(law.actuations), np.atleast_2d(law.domain.actuation)
    tops = [high if np.isfinite(high) else 1e4 for _, high in low_high]
    shares, states = (one.ravel() for one in np.meshgrid([0.0, 0.5, 1.0], np.linspace(-0.3, 0.4, 5)))
    actuation = shares * tops[0] if names == 1 else shares[:, None] * np.array(tops)
    return repr(law.evaluate(actuation, np.tile(states[:, None], len(law.axes)))), law.domain, law.axes
