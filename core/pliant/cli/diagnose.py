"""`pliant diagnose`: which physical effect is missing."""

from __future__ import annotations

from typing import Annotated

import numpy as np
import typer
from rich.table import Table

from pliant.cli.evidence_verbs import DataFile
from pliant.cli.options import DEFAULT_STORE, JsonFile, Overrides, Quiet, StoreFolder, StudyFile
from pliant.cli.session import Session, session
from pliant.diagnosis.diagnosis import Diagnosis
from pliant.diagnosis.diagnosis import diagnose as diagnose_with
from pliant.diagnosis.diagnosis_json import diagnosis_json, parameters
from pliant.diagnosis.table import UNKNOWN, Kinds
from pliant.diagnosis.words import explanation, headline, named
from pliant.evidence.measured import measurement_of_study
from pliant.evidence.prediction import Predictor
from pliant.evidence.words import number, percent

Candidates = Annotated[
    list[str] | None,
    typer.Option("--effect", metavar="KIND", help="Candidate, may be repeated; all effects by default."),
]
MOST_SHOWN = 6


def diagnose(
    study: StudyFile,
    overrides: Overrides = None,
    data: DataFile = None,
    effect: Candidates = None,
    store: StoreFolder = DEFAULT_STORE,
    json: JsonFile = None,
    quiet: Quiet = False,
) -> None:
    """Which physical effect is missing, how sure, what to measure next."""
    with session("diagnose", json, quiet) as here:
        loaded = here.study(study, overrides)
        bench = here.bench(store)
        measurement = measurement_of_study(bench, loaded, data)
        predictor = Predictor.of_study(bench, loaded, measurement)
        kinds = effect or here.registry.kinds("effect")
        task = here.progress.begin("fitting effects", 1 + len(kinds))
        found = diagnose_with(predictor, kinds=kinds, tick=lambda _: task.advance())
        task.finish()
        here.result.update({"study": loaded.name, "data": measurement.source, **diagnosis_json(found)})
        _say(here, found)


def _say(here: Session, found: Diagnosis) -> None:
    here.say(_hypotheses(found))
    if found.not_excited:
        here.say("not shown by these runs:")
        for kind, run in found.not_excited.items():
            here.say(f"  {kind}: {run}" if run else f"  {kind}")
    for remark in found.remarks:
        here.say(f"note: {remark}")
    here.say(headline(found))
    for line in explanation(found, here.registry):
        here.say(line)


def _hypotheses(found: Diagnosis) -> Table:
    table = Table(box=None, pad_edge=False, header_style="bold")
    table.add_column("hypothesis")
    for name in ("probability", "left-out error / floor"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("parameters")
    for kinds in list(found.judgement.probability)[:MOST_SHOWN]:
        table.add_row(
            named(kinds),
            percent(found.judgement.probability[kinds]),
            _ratio(found, kinds),
            _values(found, kinds),
        )
    return table


def _ratio(found: Diagnosis, kinds: Kinds) -> str:
    square = found.noise.floor_square if kinds == UNKNOWN else found.table.rows[kinds].heldout_square
    ratio = found.table.over_floor(square)
    return number(ratio, 3) if np.isfinite(ratio) else "–"


def _values(found: Diagnosis, kinds: Kinds) -> str:
    if kinds == UNKNOWN:
        return ""
    words = []
    for name, entry in parameters(found.fits[kinds], found.noise.n_effective).items():
        unit = "" if entry["unit"] == "1" else f" {entry['unit']}"
        flag = "" if entry["plausible"] else " (implausible)"
        words.append(f"{name.partition('.')[2]} {entry['value']:.3g} ± {entry['sd']:.1g}{unit}{flag}")
    return ", ".join(words)
