"""Effects fitted in addition to a study's own as a document: parameters, and the reduction of the error."""

from __future__ import annotations

from typing import Any

import numpy as np

from pliant.diagnosis.diagnosis import in_plain_words
from pliant.diagnosis.extension import Extension
from pliant.diagnosis.readings import Score
from pliant.diagnosis.steps import change_in_words
from pliant.formatting import listed, number, output_unit, plural
from pliant.records.measurement import Measurement
from pliant.records.remark import Rank, Remark
from pliant.registry.discovery import Registry
from pliant.report.document import Document
from pliant.report.fitted import caveat, doubtful, errors_json, floors_json, parameters_brief, parameters_json
from pliant.report.posterior import fitted_posterior_json, posterior_words, shares_brief


def extension_document(
    title: str, measurement: Measurement, extension: Extension, registry: Registry
) -> Document:
    """Return the document of `pliant extend`."""
    notes = [*measurement.remarks, *extension.remarks]
    doubts = doubtful(extension.uncertainty)
    n, k = extension.after.n, len(extension.fit.x)
    if n <= k:
        few = f"{plural(n, 'reading')} for {plural(k, 'parameter')}"
        doubts.append(f"{few}: any model fits so few, and none are left to test this one.")
    if not extension.fit.converged:
        doubts.append("the fit had not converged when it was stopped; check its error.")
    if not extension.noise.judged:
        said = "without repeats or a stated sigma the floor holds fast noise only."
        doubts.append(Remark(said, Rank.FLOOR))
    shares = shares_brief(extension)
    falls = []
    for name, rmse in extension.after.rmse.items():
        unit = output_unit(name)
        before = unit.text(extension.before.rmse[name], 3)
        falls.append(f"{unit.label}: {before} → {unit.text(rmse, 3)} rms, all readings")
    sentence = f"With {listed(list(extension.kinds))}: {_errors(extension)}."
    if extension.heldout is not None and extension.heldout.over_floor >= extension.before.over_floor:
        sentence += " It does not fall on conditions left out: this is no improvement."
    return Document(
        kind="Pliant: effects fitted",
        title=title,
        sentence=_absent(extension, registry) if extension.absent else sentence,
        data={**extension_json(extension), "remarks": notes},
        brief=(
            *(line for kind in extension.kinds for line in in_plain_words(registry, kind, signature=False)),
            parameters_brief(extension.uncertainty),
            *([shares] if shares else []),
            *posterior_words(extension),
            *falls,
        ),
        warnings=tuple(map(caveat, (*notes, *doubts))),
        footer=f"Measurement: {measurement.source or 'given in memory'}",
    )


def extension_json(extension: Extension) -> dict[str, Any]:
    """Return the keys of docs/extend_and_improve.md."""
    heldout = extension.heldout
    return {
        "effects": list(extension.kinds),
        "parameters": parameters_json(extension.uncertainty, extension.values),
        "correlation": extension.uncertainty.correlation,
        "posterior": fitted_posterior_json(extension),
        "before": _score(extension.before),
        "after": _score(extension.after),
        "heldout": {} if heldout is None else errors_json(heldout),
        "rmse_over_floor": np.nan if heldout is None else heldout.over_floor,
        "noise_floor": floors_json(extension.noise.floors),
        "n_effective": extension.noise.n_effective,
        "judged": extension.noise.judged,
        "converged": extension.fit.converged,
        "absent": list(extension.absent),
    }


def cited(measurement: Measurement) -> str:
    """Return the measurement's file and the first digits of its SHA-256."""
    return f"{measurement.source} (sha256 {measurement.sha256[:8]})"


def origin(extension: Extension, measurement: Measurement) -> str:
    """Return the origin of fitted values."""
    return f"fitted to {cited(measurement)}; {_errors(extension)}"


def _score(score: Score) -> dict[str, Any]:
    return {"outputs": errors_json(score), "rmse_over_floor": score.over_floor}


def _absent(extension: Extension, registry: Registry) -> str:
    sentences = []
    for kind in extension.absent:
        notes = registry.get("effect", kind).implementation_class().notes
        run = f" A run that would show it: {notes.excitation}" if notes.excitation else ""
        sentences.append(
            f"These readings show no {kind}: its strength is not distinguishable from zero.{run}"
        )
    return " ".join([*sentences, "No study was written."])


def _errors(extension: Extension) -> str:
    where = "on the readings fitted" if extension.heldout is None else "on conditions left out"
    before, last = extension.before, extension.heldout or extension.after
    if np.isfinite(last.over_floor):
        return f"error {number(before.over_floor, 3)} → {number(last.over_floor, 3)} times the noise {where}"
    return f"error {change_in_words(before, last)}, {where}"
