"""`pliant extend`: fit an effect and write a study that contains it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.table import Table

from pliant.cli.compare import DataFile
from pliant.cli.new_study import Force, Full, check_target
from pliant.cli.options import DEFAULT_STORE, JsonFile, Overrides, Quiet, StoreFolder, StudyFile
from pliant.cli.session import Session, session
from pliant.config.study import Study
from pliant.diagnosis.extended_study import write_extended_study
from pliant.diagnosis.extension import Extension, Ground
from pliant.diagnosis.extension import extend as extend_with
from pliant.diagnosis.scores import score_json
from pliant.diagnosis.uncertainty import Uncertainty
from pliant.errors import UserError
from pliant.evidence.measured import measurement_of_study
from pliant.formatting import listed, number, unit_of
from pliant.records.measurement import Measurement
from pliant.report.diagnosis_words import estimate_cells

Effects = Annotated[
    list[str] | None,
    typer.Option("--effect", metavar="KIND", help="Effect to fit; repeat the option for several."),
]
NewStudy = Annotated[
    Path | None,
    typer.Option(
        "--out", metavar="NEW.yaml", help="The new study; <study>+<kind>.yaml beside it by default."
    ),
]
Refit = Annotated[bool, typer.Option("--refit", help="Fit the effects that the study has already anew, too.")]
NOT_REACHED = 3


def extend(
    study: StudyFile,
    overrides: Overrides = None,
    effect: Effects = None,
    data: DataFile = None,
    out: NewStudy = None,
    refit: Refit = False,
    force: Force = False,
    full: Full = False,
    store: StoreFolder = DEFAULT_STORE,
    json: JsonFile = None,
    quiet: Quiet = False,
) -> None:
    """Fits an effect, writes a new study that contains it, with its uncertainty; comments are kept."""
    with session("extend", json, quiet) as here:
        installed = here.registry
        loaded = here.study(study, overrides)
        kinds = _kinds(here, loaded, effect, refit)
        target = out or study.with_name(f"{study.stem}+{'+'.join(effect or [])}.yaml")
        check_target(study, target, force)
        bench = here.bench(store)
        measurement = measurement_of_study(bench, loaded, data)
        ground = Ground.of(bench, loaded, measurement)
        found = extend_with(ground, loaded.effects, kinds)
        here.result.update(extension_json(found))
        remarks = [*measurement.remarks, *ground.predictor.remarks]
        here.result |= {
            "study": loaded.name,
            "data": measurement.source,
            "data_sha256": measurement.sha256,
            "out": None,
            "remarks": remarks,
        }
        for remark in remarks:
            here.say(f"note: {remark}")
        _say(here, found)
        if found.absent:
            here.say(_absent_words(here, found))
            here.exit_code = NOT_REACHED
            return
        note = fit_note(found, measurement)
        write_extended_study(
            study, target, loaded, overrides or (), found, note, installed, data=data, full=full
        )
        here.result["out"] = str(target)
        here.say(_outcome(found))
        here.say(f"study    {target}")


def fit_note(found: Extension, measurement: Measurement) -> str:
    """Where fitted values come from."""
    return f"fitted to {cited(measurement)}; {_errors(found)}"


def cited(measurement: Measurement) -> str:
    """The measurement's file and the first digits of its SHA-256."""
    return f"{measurement.source} (sha256 {measurement.sha256[:8]})"


def extension_json(found: Extension) -> dict[str, Any]:
    """The keys of docs/extend_and_improve.md."""
    heldout = found.heldout
    return {
        "effects": list(found.kinds),
        "parameters": parameters_json(found.uncertainty, found.values),
        "correlation": found.uncertainty.correlation,
        "before": {"outputs": score_json(found.before), "rmse_over_floor": found.before.over_floor},
        "after": {"outputs": score_json(found.after), "rmse_over_floor": found.after.over_floor},
        "heldout": {} if heldout is None else score_json(heldout),
        "rmse_over_floor": np.nan if heldout is None else heldout.over_floor,
        "noise_floor": {
            name: {"value": floor.value, "unit": floor.unit, "source": floor.source, "se": floor.se}
            for name, floor in found.noise.floors.items()
        },
        "n_effective": found.noise.n_effective,
        "judged": found.noise.judged,
        "converged": found.fit.converged,
        "absent": list(found.absent),
    }


def parameters_json(uncertainty: Uncertainty, values: dict[str, float] | Any) -> dict[str, Any]:
    """By ``kind.name``."""
    return {
        e.name: {
            "value": values[e.name],
            "sd": e.sd,
            "low": e.low,
            "high": e.high,
            "open_low": e.open_low,
            "open_high": e.open_high,
            "unit": e.parameter.unit,
            "plausible": e.plausible,
            "at_limit": e.at_limit,
            "includes_neutral": e.includes_neutral,
        }
        for e in uncertainty.estimates
    }


def parameter_table(uncertainty: Uncertainty) -> Table:
    """Value, uncertainty and interval of each parameter."""
    table = Table(box=None, pad_edge=False, header_style="bold")
    table.add_column("parameter")
    for name in ("value", "sd", "90 % interval", "unit"):
        table.add_column(name, justify="right", no_wrap=True)
    for e in uncertainty.estimates:
        table.add_row(*estimate_cells(e))
    return table


def say_parameters(here: Session, uncertainty: Uncertainty) -> None:
    """The table, and below it what speaks against a value."""
    here.say(parameter_table(uncertainty))
    for e in uncertainty.estimates:
        for doubt in e.doubts:
            here.say(f"note: {e.name}: {doubt}")


def _kinds(here: Session, study: Study, effect: list[str] | None, refit: bool) -> list[str]:
    if not effect:
        raise UserError(
            f"name the effect: pliant extend STUDY.yaml --effect KIND. 'pliant diagnose' says which; there are "
            f"{', '.join(here.registry.kinds('effect'))}."
        )
    for kind in effect:
        here.registry.get("effect", kind)
    return [*(present.kind for present in study.effects if refit), *effect]


def _say(here: Session, found: Extension) -> None:
    say_parameters(here, found.uncertainty)
    for name, rmse in found.after.rmse.items():
        words = unit_of(name)
        here.say(
            f"{words.label}: {words.text(found.before.rmse[name], 3)} → {words.text(rmse, 3)} rms, all readings"
        )
    if not found.fit.converged:
        here.say("note: the fit still moved when it was stopped; look at the error before you believe it.")
    if not found.noise.judged:
        here.say("note: without repeats or a stated sigma the floor holds fast noise only.")


def _absent_words(here: Session, found: Extension) -> str:
    sentences = []
    for kind in found.absent:
        notes = here.registry.get("effect", kind).implementation_class().notes
        run = f" A run that would show it: {notes.excited_by}" if notes.excited_by else ""
        sentences.append(f"These readings show no {kind}: its strength is not told from zero.{run}")
    return " ".join([*sentences, "No study was written."])


def _outcome(found: Extension) -> str:
    text = f"With {listed(list(found.kinds))}: {_errors(found)}."
    heldout = found.heldout
    if heldout is not None and heldout.over_floor >= found.before.over_floor:
        text += " It does not fall on conditions left out: this is no improvement."
    return text


def _errors(found: Extension) -> str:
    heldout = found.heldout
    last, where = (
        (found.after, "on the readings fitted") if heldout is None else (heldout, "on conditions left out")
    )
    return (
        f"error {number(found.before.over_floor, 3)} → {number(last.over_floor, 3)} times the noise {where}"
    )
