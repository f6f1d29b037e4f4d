"""The long work of the page: fit the ticked effects, diagnose, improve; each gives JSON values to store."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pliant import api
from pliant.config.study import Study
from pliant.config.writing import StudyDraft, study_name_from_path
from pliant.diagnosis.candidates import candidate_kinds
from pliant.diagnosis.diagnosis import Diagnosis, next_words
from pliant.diagnosis.diagnosis import diagnose as diagnose_with
from pliant.diagnosis.evidence_table import sorted_kinds
from pliant.diagnosis.extension import Extension, Ground, extend, write_extended_study
from pliant.diagnosis.learned_term import LearnedTerm
from pliant.diagnosis.learned_words import described
from pliant.diagnosis.steps import Improvement
from pliant.errors import UserError
from pliant.evidence.opening import measured_model
from pliant.experiments.experiment_catalogue import own_runs
from pliant.experiments.protocol_file import write_protocol
from pliant.formatting import display_unit, whole_percent
from pliant.interfaces.effect import EffectConfig
from pliant.measurements.files import expand_sources
from pliant.records.plain_values import plain
from pliant.registry.discovery import discover
from pliant.report.diagnosis import diagnosis_document
from pliant.report.document import Document, capital
from pliant.report.extension import cited, origin
from pliant.report.improvement import improvement_document, stands_for
from pliant.report.improvement import origin as improvement_origin
from pliant.report.learned import covariate_curve
from pliant.report.render import page
from pliant.report.stored_answer import Question
from pliant.store.store import write_atomically
from pliant_app.folder import SessionFolder
from pliant_app.open_model import OpenModel, StoppedError
from pliant_app.page_state import Effects
from pliant_app.unseen_runs import fit_doubts, step_doubts

Tick = Callable[[str], None]
# Modules that a diagnosis of the page is computed with, besides effects and engine.
MODULES = ("pliant_app.work", "pliant.diagnosis.diagnosis", "pliant.report.diagnosis")
# Why the page and the command may differ: they use different runs.
ASKS_ALL = "This result is from the other runs; 'pliant diagnose' uses all runs, and its result may differ."
# A ticked effect below this probability is reported as unlikely.
UNLIKELY = 0.05


@dataclass(frozen=True)
class ModelWork:
    """The input of long work: the model, the effects that it begins from, and the progress of its job."""

    model: OpenModel
    effects: Effects
    tick: Tick
    stopped: Callable[[], bool]

    @property
    def ground(self) -> Ground:
        """The training runs, with a predictor that this job's stop interrupts."""
        return replace(self.model.ground, predictor=self.model.ground.predictor.watched(self.heed))

    def heed(self) -> None:
        """Raise `StoppedError` after a stop was requested."""
        if self.stopped():
            raise StoppedError


def fit(
    task: ModelWork, folder: SessionFolder, key: str, kinds: Sequence[str], forms: Sequence[str] = ()
) -> dict[str, Any]:
    """Fit effects of these kinds by `pliant extend`, on the training runs; a study with them is written.

    `forms`: kinds whose forms are fitted too, as in `pliant improve` after a diagnosis that calls for it.
    """
    model, ground = task.model, task.ground
    kinds = candidate_kinds(model.context.registry, kinds)
    begun = model.effects(tuple(one for one in task.effects if one["kind"] in _own(model)))
    without = {
        kind: extend(
            ground,
            begun,
            [one for one in kinds if one != kind],
            forms=[one for one in forms if one != kind],
            profiles=False,
        )
        for kind in kinds
        if len(kinds) > 1
    }
    found = extend(ground, begun, kinds, forms=forms, smaller=tuple(without.values()))
    file = _study_name(model, kinds, key)
    study = model.study.model_copy(update={"effects": begun})
    note = f"{origin(found, model.measurement)}; {len(model.split.runs)} runs held out"
    _write(folder.results / file, model, study.effects, found, note)
    effects = tuple(effect.canonical() for effect in found.effects)
    return {
        "what": "fit",
        "kinds": list(kinds),
        "effects": effects,
        "estimates": _estimates(found),
        "absent": list(found.absent),
        "converged": found.fit.converged,
        **_errors(model, tuple(one.canonical() for one in begun), effects),
        "warnings": fit_doubts(model, ground, begun, found, without),
        "study": file,
    }


def diagnose(task: ModelWork, folder: SessionFolder, key: str) -> dict[str, Any]:
    """Run `pliant diagnose` of the present model on the training runs, or read it from the store."""
    model = task.model
    study = model.study.model_copy(update={"effects": model.effects(task.effects)})
    # The result names files by the key, and the file of the next run names the study and the data.
    options = {"key": key, "paths": [str(path) for path in (model.path, *model.data)]}
    question = Question(model.context, study, model.split.training, options, MODULES)
    kept = question.find(lambda: _diagnosed(task, study, folder, key)).value
    for name, text in kept["files"].items():
        write_atomically(folder.results / name, text)
    return dict(kept["result"])


def _diagnosed(task: ModelWork, study: Study, folder: SessionFolder, key: str) -> dict[str, Any]:
    """Return the result that the page keeps, and the texts of the files that it names."""
    model = task.model
    predictor = measured_model(model.context, study, model.split.training).watched(task.heed)
    own = own_runs(study, predictor)
    found = diagnose_with(
        predictor, kinds=None, runs=own, tick=task.tick, workers=model.study.resolve_workers(None, 1)
    )
    asked = f"{model.split.why} {ASKS_ALL}" if model.split.runs else ""
    found = replace(found, remarks=(*found.remarks, *filter(None, [asked])))
    protocol = _protocol(folder, key, model, found)
    document = diagnosis_document(
        study.name, model.split.training, found, model.context.registry, next_file=protocol
    )
    result: dict[str, Any] = {
        "what": "diagnose",
        "sentence": document.sentence,
        "asked": asked,
        "verdict": found.verdict,
        "selected": list(found.selected),
        "single": {
            kinds[0]: {
                "probability": found.judgement.probability.get(kinds, 0.0),
                "left_out": found.left_out_ratio(kinds),
            }
            for kinds in found.table.rows
            if len(kinds) == 1
        },
        "by_kind": _by_kind(found, {effect.kind for effect in study.effects}),
        "had": [effect.kind for effect in study.effects],
        "forms": {"+".join(kinds): list(one.candidate.forms) for kinds, one in found.fits.items()},
        "nothing": found.left_out_ratio(()),
        "hypotheses": [
            {"kinds": list(kinds), "probability": p, "left_out": found.left_out_ratio(kinds)}
            for kinds, p in list(found.judgement.probability.items())[:8]
        ],
        "next": next_words(found),
        "next_name": found.next_run.name if found.next_run is not None and protocol else "",
        "next_run": _next_run(found) if protocol else "",
        "protocol": protocol,
        "classes": [
            {"kinds": list(one.kinds), "run": one.run, "words": one.words, "minutes": one.minutes}
            for one in found.classes
        ],
        "report": _report(folder, key, document),
    }
    names = [name for name in (result["report"], protocol) if name]
    files = {name: (folder.results / name).read_text(encoding="utf-8") for name in names}
    return {"result": plain(result), "files": files}


def _next_run(diagnosis: Diagnosis) -> str:
    """Return the run whose file is kept, in words, whatever the verdict says of it."""
    run = diagnosis.next_run
    return "" if run is None else f"The run '{run.name}' ({run.minutes:.2g} min): {run.run}; {run.why}."


def improve(task: ModelWork, folder: SessionFolder, key: str, learned: bool = False) -> dict[str, Any]:
    """Run `pliant improve` of the study on all runs that are on; the same runs are held out.

    `learned`: whether a learned term may be the last step.
    """
    model = task.model
    study = model.study.model_copy(update={"effects": model.effects(model.own_effects)})
    opened = api.OpenStudy(study, model.context)
    found = api.improve(opened, model.read, learned=learned, tick=task.tick, split=model.split)
    file = ""
    if found.final is not None or found.learned is not None:
        file = _study_name(model, ["improved"], key)
        notes = {kind: stands_for(step) for step in found.steps for kind in step.added}
        note = improvement_origin(found, cited(model.measurement))
        _write(folder.results / file, model, study.effects, found.final, note, notes, found.learned)
    document = improvement_document(study.name, model.read, found, model.context.registry)
    made = study.effects if found.final is None else found.final.effects
    if found.learned is not None:
        made = (*made, found.learned.effect)
    effects = tuple(effect.canonical() for effect in made)
    return {
        "what": "improve",
        "learned": None if found.learned is None else _learned(found.learned),
        "sentence": document.sentence,
        "stop": found.stop,
        "reason": found.reason,
        "steps": [
            {
                "words": step.named or "as it was",
                "training": step.training.over_floor,
                "aside": step.locked.over_floor if found.locked.runs else None,
                "se": step.locked_se,
                "why": step.why,
            }
            for step in found.steps
        ],
        "kinds": [kind for step in found.steps for kind in step.added],
        "effects": effects,
        "estimates": [] if found.final is None else _estimates(found.final),
        "warnings": list(dict.fromkeys([*_rises(found), *step_doubts(model, found)])),
        **_errors(model, model.own_effects, effects),
        "study": file,
        "report": _report(folder, key, document),
    }


def write_by_hand(target: Path, model: OpenModel, effects: Effects) -> None:
    """Write a study with these effects, set by hand.

    Raises:
        UserError: it cannot be written.
    """
    draft = StudyDraft(model.path)
    configs = model.effects(effects)
    meant = {**model.study.canonical(), "name": draft.name_after(target)}
    meant["effects"] = [config.canonical() for config in configs]
    draft.drop("effects")
    draft.drop("posterior")
    meant["posterior"] = None
    for slot, config in enumerate(configs):
        draft.set(("effects", slot, "kind"), config.kind, "set by hand on the evidence page, not fitted")
        for name, value in config.canonical().items():
            if name != "kind" and value is not None:
                draft.set(("effects", slot, name), value)
    _with_data(draft, meant, model)
    draft.write(target, meant, discover(), full=True)


def diagnosis_doubts(kinds: Sequence[str], diagnosis: Mapping[str, Any]) -> list[str]:
    """Return what a diagnosis says against ticked effects, in sentences."""
    by_kind: Mapping[str, float] = diagnosis.get("by_kind", {})
    best = max(by_kind.items(), key=lambda one: one[1], default=("", 0.0))
    said = []
    for kind in kinds:
        p = by_kind.get(kind)
        if p is not None and p < UNLIKELY and diagnosis.get("verdict") != "insufficient_data":
            told = f" '{best[0]}' has {whole_percent(best[1])}." if best[1] > 0.5 and best[0] != kind else ""
            said.append(f"The diagnosis gives '{kind}' a probability of {_small(p)}.{told}")
    return said


def varied_forms(kinds: Sequence[str], known: Sequence[tuple[Effects, Mapping[str, Any]]]) -> list[str]:
    """Return the kinds whose forms vary in earlier diagnoses, by the rule of `pliant improve`.

    `known`: each diagnosis with the effects of its model.
    """
    found: set[str] = set()
    for effects, diagnosis in known:
        forms: Mapping[str, list[str]] = diagnosis.get("forms", {})
        asked = sorted_kinds([kind for kind in kinds if kind not in {one["kind"] for one in effects}])
        whole = forms.get("+".join(asked))
        found.update(whole if whole is not None else [k for kind in asked for k in forms.get(kind, ())])
    return sorted(found & set(kinds))


def _small(p: float) -> str:
    return "less than 1 %" if p < 0.01 else whole_percent(p)


def _by_kind(diagnosis: Diagnosis, had: Collection[str]) -> dict[str, float]:
    """Return the probability of each effect to be among the missing ones, without effects that the model `had`.

    A hypothesis with one of these means that there is more of it, which says nothing against the present effect.
    """
    total: dict[str, float] = {kinds[0]: 0.0 for kinds in diagnosis.table.rows if len(kinds) == 1}
    for kinds, p in diagnosis.judgement.probability.items():
        for kind in kinds:
            total[kind] = total.get(kind, 0.0) + p
    return {kind: p for kind, p in total.items() if kind not in had}


def _own(model: OpenModel) -> set[str]:
    return {effect.kind for effect in model.study.effects}


def _errors(model: OpenModel, before: Effects, after: Effects) -> dict[str, Any]:
    """Return the errors of two models over one floor, that of the second model's noise."""
    later = model.predicted(after)
    noise = model.noise(later)
    return {
        "before": vars(model.errors(model.predicted(before), noise)),
        "after": vars(model.errors(later, noise)),
    }


def _estimates(extension: Extension) -> list[dict[str, Any]]:
    return [
        {
            "name": one.name,
            "kind": one.kind,
            "parameter": one.parameter.name,
            "value": extension.values[one.name],
            "sd": one.sd,
            "low": one.low,
            "high": one.high,
            "words": one.told(display_unit(one.unit)),
            "doubts": list(one.doubts),
        }
        for one in extension.uncertainty.estimates
    ]


def _learned(term: LearnedTerm) -> dict[str, Any]:
    """Return the learned term and its curve with the ends of the data; without a curve over two covariates."""
    curve = covariate_curve(term)
    told: dict[str, Any] = {"words": capital(described(term)), "curve": None}
    if curve is not None:
        axes = {"over": curve.over.text, "what": curve.what.text}
        lists = {"x": curve.x, "value": curve.value, "half": curve.half}
        told["curve"] = {**axes, **lists, "knots": [curve.knots_x, curve.knots], "ends": curve.ends}
    return told


def _study_name(model: OpenModel, added: Sequence[str], key: str) -> str:
    """Return the file's name, which is also the name of the study."""
    return f"{study_name_from_path(model.path)}+{'+'.join(added)[:60]}-{key[-6:]}.yaml"


def _rises(improvement: Improvement) -> list[str]:
    return [remark for remark in improvement.remarks if "rose from" in remark or "is still" in remark]


def _write(
    target: Path,
    model: OpenModel,
    effects: Sequence[EffectConfig],
    extension: Extension | None,
    note: str,
    notes: Mapping[str, str] | None = None,
    learned: LearnedTerm | None = None,
) -> None:
    study = model.study.model_copy(update={"effects": tuple(effects)})
    target.unlink(missing_ok=True)
    write_extended_study(
        model.path,
        target,
        study,
        (),
        extension,
        note,
        discover(),
        notes_by_kind=notes,
        learned=learned,
        data=model.data or None,
        full=True,
    )


def _with_data(draft: StudyDraft, meant: dict[str, Any], model: OpenModel) -> None:
    if not model.data:
        return
    files = [str(file.absolute()) for file in model.data]
    named: Any = files[0] if len(files) == 1 else files
    draft.set(("measurements", "file"), named)
    meant["measurements"] = {**(meant.get("measurements") or {}), "file": named if len(files) == 1 else files}


def _protocol(folder: SessionFolder, key: str, model: OpenModel, diagnosis: Diagnosis) -> str:
    """Return the file of the next run; empty where none is proposed."""
    planned = diagnosis.next_run.planned if diagnosis.next_run is not None else None
    if planned is None:
        return ""
    notes = model.study.measurements
    named = model.data or (notes.file if notes is not None else ())
    name = f"{study_name_from_path(Path(planned.name))}-{key[-6:]}.csv"
    write_protocol(
        folder.results / name,
        planned,
        model.measurement.outputs,
        measurement=model.measurement,
        notes=notes,
        study=str(model.path),
        data=[str(file) for file in expand_sources(named)] if named else (),
    )
    return name


def _report(folder: SessionFolder, key: str, document: Document) -> str:
    """Return the command's own report; a picture that cannot be drawn costs the report, not the result."""
    name = f"{key}.html"
    try:
        write_atomically(folder.results / name, page(document).html)
    except (UserError, OSError, np.linalg.LinAlgError):
        return ""
    return name
