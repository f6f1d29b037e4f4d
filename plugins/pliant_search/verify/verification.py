"""Verification of the best design: laws fitted to direct FEM, and the task in every engine."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pliant.config.design_parameters import design_parameters, spoken
from pliant.config.study import Study
from pliant.errors import PliantError, interrupted
from pliant.execution.progress import open_progress_bar
from pliant.interfaces.family import FamilyConfig
from pliant.interfaces.physics import PhysicsConfig
from pliant.pipeline.segments import DesignStages
from pliant.pipeline.simulate import simulate_stage
from pliant.pipeline.study import build_study_chain, build_study_laws, study_physics
from pliant.pipeline.workbench import RunContext
from pliant.records.design import Array
from pliant.records.fem import ModuleData
from pliant.records.law import JointLaw
from pliant.records.rollout import TaskResult
from pliant.units import strip_unit_suffix
from pliant_designs.solved_designs import scored_states
from pliant_search.config import SearchConfig
from pliant_search.evaluate.evaluator import measured, numbers, shared_means
from pliant_search.evaluate.solid_metrics import solid_metrics
from pliant_search.problem.search_problem import SearchProblem
from pliant_search.problem.study_setter import changed
from pliant_search.records import FoundDesign, Verification
from pliant_search.verify.direct_fem import direct_studies, solvable

BAND = 0.9
Numbers = Mapping[str, float]
NO_FEM = "verify.fem is false: the laws of the best design were not checked by FEM."
NOT_SOLVABLE = (
    "The laws of this study are stated or come from tables of their own and do not depend on the design, so there is "
    "nothing that FEM could check."
)
Case = tuple[str, Study]  # a condition, and the design's study in it


def verify(context: RunContext, problem: SearchProblem, best: FoundDesign) -> Verification:
    """Check a design in all conditions, or in the condition that it was found for.

    Failures (an engine that is not installed or fails, FEM that does not converge) become notes.

    Args:
        context: plugins and store; later checks reuse its FEM and fits.
        problem: the `SearchProblem`.
        best: the design.

    Raises:
        UserError: the design cannot be written into the study, or `verify.change` cannot.
    """
    started, notes = time.perf_counter(), list[str]()
    cases = verification_cases(context, problem, best)
    predicted = _simulated(context, problem, cases, "with the laws of the search", notes)
    verified: dict[str, dict[str, Numbers]] = {}
    laws: tuple[Mapping[str, Any], ...] = ()
    fem_wall_s = 0.0
    if not solvable(problem.study):
        unwanted = problem.config.verify is not None and not problem.config.verify.fem
        notes.append(NO_FEM if unwanted else NOT_SOLVABLE)
    else:
        studies, chosen = direct_studies(context, [study for _, study in cases])
        notes += chosen
        direct = [(condition, study) for (condition, _), study in zip(cases, studies, strict=True)]
        try:
            laws, fem_wall_s = _laws(context, cases, direct)
        except PliantError as error:
            notes.append(f"Direct FEM of the design failed: {error}")
        else:
            verified = _simulated(context, problem, direct, "with laws from direct FEM", notes)

    def means(engines: Mapping[str, Mapping[str, Numbers]]) -> dict[str, Numbers]:
        whole = {
            engine: list(found.values()) for engine, found in engines.items() if len(found) == len(cases)
        }
        return {engine: shared_means(found) for engine, found in whole.items()}

    whole = means(verified)
    return Verification(
        predicted=means(predicted),
        verified=whole,
        conditions=verified,
        laws=laws,
        fem_wall_s=fem_wall_s,
        wall_s=time.perf_counter() - started,
        notes=tuple(dict.fromkeys(notes)),
        broken={
            engine: broken
            for engine, metrics in whole.items()
            if (broken := problem.metric_violations(best.values, metrics))
        },
    )


def verification_cases(context: RunContext, problem: SearchProblem, best: FoundDesign) -> list[Case]:
    """Return the design's study in each of its conditions, with `verify.change` applied.

    Raises:
        UserError: the design or the change cannot be written into the study.
    """
    change = problem.config.verify.change if problem.config.verify is not None else {}
    return [
        (condition.name, changed(context.registry, problem.apply(best.values, index), change))
        for index, condition in enumerate(problem.conditions)
        if best.context in (-1, index)
    ]


def _simulated(
    context: RunContext, problem: SearchProblem, cases: Sequence[Case], what: str, notes: list[str]
) -> dict[str, dict[str, Numbers]]:
    """Return engine → condition → metrics; an engine that fails adds a note instead."""
    engines = check_engines(context, cases[0][1])
    found: dict[str, dict[str, Numbers]] = {}
    with open_progress_bar(context.progress, f"check {what}", len(engines) * len(cases)) as bar:
        for condition, study in cases:
            trials = getattr(study.task, "trials", None)
            for engine in engines:
                place = f"{engine.kind}, {what}" + (f", {condition}" if len(cases) > 1 else "")
                bar.describe(place)
                try:
                    result = run_in(context, study, engine)
                    solid = solid_metrics(context, problem, study)
                except Exception as error:  # keep the other engines' results
                    if interrupted(error):
                        raise KeyboardInterrupt from None
                    name = "" if isinstance(error, PliantError) else f"{type(error).__name__}: "
                    notes.append(f"{place}: {name}{error}")
                else:
                    own = {"trials": float(trials)} if trials is not None else {}
                    found.setdefault(engine.kind, {})[condition] = (
                        numbers({**solid, **measured(result)}) | own
                    )
                    if result.not_reached or not result.final.converged:
                        notes.append(f"{place}: {result.not_reached or 'the chain did not settle.'}")
                bar.advance()
    return found


def check_engines(context: RunContext, study: Study) -> list[PhysicsConfig]:
    """Return the engines in which a design is checked, the study's own first."""
    return [study_physics(context, study), *study.cross_check]


def run_in(context: RunContext, study: Study, engine: PhysicsConfig) -> TaskResult:
    """Return the task of a study in one engine, through the store."""
    source = build_study_chain(context, study, mounted=True)
    result: TaskResult = simulate_stage(context, source, engine, study.noisy_task(), study.effects).value
    return result


def _laws(
    context: RunContext, cases: Sequence[Case], direct: Sequence[Case]
) -> tuple[tuple[Mapping[str, Any], ...], float]:
    """Return the errors of the search's laws against FEM, each distinct design once, and the time of FEM."""

    def by_family(study: Study) -> dict[str, DesignStages]:
        """Return the stages by a text that identifies the family, whatever the source of its law."""
        stages = build_study_laws(context, study)
        return {repr(one.family.canonical()) if one.family is not None else "": one for one in stages}

    found: dict[str, tuple[DesignStages, DesignStages]] = {}
    for (_, case), (_, other) in zip(cases, direct, strict=True):
        of_search = by_family(case)
        for key, stages in by_family(other).items():
            if stages.fem is not None and key in of_search:
                found.setdefault(key, (of_search[key], stages))
    names = design_names([one.family for one, _ in found.values()], cases[0][1])
    laws = []
    for name, (searched, solved) in zip(names, found.values(), strict=True):
        assert solved.fem is not None
        misses = law_errors(searched.law.law, solved.fem.value, name)
        report = solved.law.report
        fit = {"fit_worst_of_range": report.worst_of_range} if report is not None else {}
        laws.append({**misses, **fit, "fem_wall_s": float(solved.fem.manifest["wall_s"])})
    return tuple(laws), sum(law["fem_wall_s"] for law in laws)


def design_names(families: Sequence[FamilyConfig | None], study: Study) -> list[str]:
    """Return a name of each design by the parameters that differ, or for a single design those that are searched."""
    parameters = [design_parameters(family) if family is not None else {} for family in families]
    names = list(dict.fromkeys(name for one in parameters for name in one))
    differ = [name for name in names if len({repr(one.get(name)) for one in parameters}) > 1]
    search: SearchConfig | None = study.block("search")
    if not differ and search is not None:
        keys = [key for name, one in search.variables.items() for key in one.keys(name)]
        searched = {strip_unit_suffix(key.rpartition(".")[2]) for key in keys if "family." in key}
        differ = [name for name in names if strip_unit_suffix(name) in searched]
    return [spoken({name: one[name] for name in differ}) for one in parameters]


def law_errors(law: JointLaw, data: ModuleData, name: str = "") -> dict[str, Any]:
    """Return the errors of a law on all trusted states of a design, fitted or held out, scored as meta-models are.

    Lateral axes are scored only in states that move them.

    Args:
        law: of the search; its axes are those of the data.
        data: direct FEM of the design.
        name: of the design.

    Returns:
        `rmse_of_largest`, `worst_of_largest`: shares of the largest |τ| of these states, over all axes;
        `rmse_of_range`, `worst_of_range`: shares of max − min of each axis' τ, of the worst axis; `largest_effort`
        (N·m, or N); `n_states`; `n_outside`: those of them outside the law's own domain; `in_band`: share of the
        states inside the law's 90 % band, NaN where it states none; `axes`: axis → its own shares and `n_states`.
    """
    keep, counts = scored_states(data)
    order = [data.axes.index(axis) for axis in law.axes]
    p, u, tau = data.actuation[keep], data.deformation[keep][:, order], data.tau[keep][:, order]
    counts = counts[:, order]
    if not counts.any():
        return {"name": name, "n_states": 0, "axes": {}}
    miss = law.evaluate(p, u).tau - tau
    largest = float(np.abs(tau[counts]).max()) or 1.0
    band = law.band(p, u, BAND)
    axes = {}
    for k, axis in enumerate(law.axes):
        rows = counts[:, k]
        if rows.any():
            rmse, worst, off = _rms(miss[rows, k]), float(np.abs(miss[rows, k]).max()), tau[rows, k]
            width, own_largest = float(np.ptp(off)) or 1.0, float(np.abs(off).max()) or 1.0
            axes[axis] = {
                "n_states": int(rows.sum()),
                "rmse_of_range": rmse / width,
                "worst_of_range": worst / width,
                "rmse_of_largest": rmse / own_largest,
                "worst_of_largest": worst / own_largest,
            }
    return {
        "name": name,
        "n_states": len(p),
        "n_outside": int(np.any(law.domain.excess(p, u) != 0, axis=1).sum()),
        "largest_effort": largest,
        "rmse_of_largest": _rms(miss[counts]) / largest,
        "worst_of_largest": float(np.abs(miss[counts]).max()) / largest,
        "rmse_of_range": max(one["rmse_of_range"] for one in axes.values()),
        "worst_of_range": max(one["worst_of_range"] for one in axes.values()),
        "in_band": float("nan") if band is None else float(np.mean((np.abs(miss) <= band)[counts])),
        "axes": axes,
    }


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
