"""Export of a study with a block `model`: the improved model, or the numbers of its effects."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from pliant import api
from pliant.cli.session import Session, check_writable
from pliant.config.study import Study
from pliant.errors import UserError
from pliant.evidence.driven_model import DrivenModel
from pliant.interfaces.model import Improved
from pliant.records.measurement import Measurement
from pliant_export.parameter_table import ParameterRow, parameter_rows, write_parameters

TABLES = (".csv", ".json")
# Endings of the files that an exported model has beside it.
BESIDE = (".py", ".check.json")
CHECKED_RUNS, CHECKED_SAMPLES = 2, 1000


def export_system(session: Session, study: Study, out: Path, force: bool = False) -> None:
    """Write the improved model in its own format, or a table of parameters.

    Raises:
        UserError: it cannot be written, or a file is there already and `force` is not given.
    """
    table = out.suffix.lower() in TABLES
    beside = () if table else tuple(out.with_suffix(ending) for ending in BESIDE)
    there = [file for file in (out, *beside) if file.exists()]
    if there and not force:
        names = " and ".join(str(file) for file in there)
        raise UserError(
            f"{names} {'are' if len(there) > 1 else 'is'} there already; give another --out, or --force to overwrite."
        )
    check_writable(out.parent)
    model = api.predictor(api.OpenStudy(study, session.context()))
    assert isinstance(model, DrivenModel)
    measurement = model.measurement
    fitted = f"{measurement.source} (sha256 {measurement.sha256[:8]})"
    rows = parameter_rows(study, model)
    if table:
        every = [row for some in rows for row in some]
        if not every:
            raise UserError(
                f"study '{study.name}' has no effects; 'pliant improve' writes a study with them."
            )
        session.result.update({"files": [write_parameters(every, out, fitted)], "format": "parameters"})
        session.say(f"written  {out} ({len(every)} parameter{'s' if len(every) > 1 else ''})")
        return
    checked = model.for_runs(_first_runs(measurement))
    provenance = tuple(
        _provenance(some, effect.kind, fitted) for some, effect in zip(rows, study.effects, strict=True)
    )
    improved = Improved(
        study.name,
        tuple(model.context.build("effect", config) for config in study.effects),
        provenance,
        model.unchanged,
        tuple(checked.commanded),
        tuple(checked.evaluate().runs),
    )
    exported = model.system.export(improved, out)
    session.result.update(
        {"files": list(exported.files), "format": model.system.config.kind, "acts": dict(exported.acts)}
    )
    for file in exported.files:
        session.say(f"written  {file}")
    for kind, place in exported.acts.items():
        session.say(f"{kind}: {place}")
    for sentence in exported.sentences:
        session.say(sentence)


def _provenance(rows: list[ParameterRow], kind: str, fitted: str) -> str:
    """Return what is known of an effect, in a line."""
    numbers = "; ".join(row.words for row in rows)
    known = f"fitted to {fitted}" if any(row.sd is not None for row in rows) else "as the study states it"
    return f"{kind}: {numbers}; {known}" if numbers else f"{kind}: {known}"


def _first_runs(measurement: Measurement) -> Measurement:
    """Return the first runs of a measurement, their beginnings only."""
    runs = measurement.runs[:CHECKED_RUNS]
    return replace(measurement, runs=tuple(run.at(np.arange(min(len(run), CHECKED_SAMPLES))) for run in runs))
