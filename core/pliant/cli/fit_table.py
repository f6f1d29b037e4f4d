"""`pliant fit TABLE.csv`: anybody's states become a law with error bars, and a study that uses it."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path

from pliant.cli.session import Session, check_writable, plain
from pliant.errors import MissingDependencyError, UserError
from pliant.interfaces.surrogate import SurrogateConfig
from pliant.pipeline.study import Design, DesignStages
from pliant.pipeline.surrogate import law_stage
from pliant.pipeline.workbench import Workbench
from pliant.records.law import JointLaw
from pliant.report.fit import fitted_law, stored_fit_page, table_document
from pliant.report.fit_view import Fitted
from pliant.store.store import write_atomically

STUDY, RESULT = "study.yaml", "fit.json"


def fit_table(
    here: Session,
    source: Path,
    kind: str,
    compare: bool,
    out: Path | None,
    store: Path,
    learning: bool = True,
) -> None:
    """Fit, print, and write what was asked for. Raises `UserError` for whatever is wrong with the table."""
    if out is not None:
        _check_free(source, kind, out)
        check_writable(out)
    bench = here.bench(store)
    try:
        stages, own = _fitted(bench, source, kind, learning and out is not None)
    except UserError:
        if out is not None and not any(out.iterdir()):
            out.rmdir()
        raise
    fitted, problems = [own], {}
    for other in here.registry.kinds("surrogate") if compare else ():
        try:
            fitted += [_fitted(bench, source, other, False)[1]] if other != kind else []
        except (UserError, MissingDependencyError) as error:
            problems[other] = str(error)
    document = table_document(source, stages, fitted, problems)
    if out is None:
        here.show(document)
        return
    here.result.update(document.data)
    document = replace(document, brief=(*document.brief, _write(here, source, kind, own.law, out)))
    here.show(document, out, stored_fit_page(bench, document, fitted[:1], {}, fitted))


def _fitted(bench: Workbench, source: Path, kind: str, learning: bool) -> tuple[DesignStages, Fitted]:
    config = (
        bench.registry.get("surrogate", kind).config_model().model_validate({"kind": kind, "data": source})
    )
    assert isinstance(config, SurrogateConfig)
    stage = law_stage(bench, config, None)
    stages = DesignStages(Design(None, config), None, stage)
    return stages, fitted_law(bench, kind, config, stage, learning=learning, source=source.name)


def _check_free(source: Path, kind: str, out: Path) -> None:
    """Raise `UserError` where the folder holds a study of another law; one of this law may have been edited."""
    study = out / STUDY
    if study.exists() and _law_line(source, kind, out) not in study.read_text(
        encoding="utf-8", errors="replace"
    ):
        raise UserError(f"{study} is there already, of another law; give another --out.")


def _write(here: Session, source: Path, kind: str, law: JointLaw, out: Path) -> str:
    """Write the study, unless it is there already, and the result; returns the line that says so."""
    study = out / STUDY
    kept = study.exists()
    if not kept:
        write_atomically(study, _study(source, kind, law, out))
    write_atomically(out / RESULT, json.dumps(plain(here.result), indent=1, allow_nan=False) + "\n")
    here.result["study"] = str(study)
    what = "kept as it was;" if kept else "set the chain's measures in it, then"
    return f"study    {study}: {what} 'pliant run {study}'"


def _law_line(source: Path, kind: str, out: Path) -> str:
    """The line of the study that says where its law comes from."""
    table = json.dumps(os.path.relpath(source, out).replace(os.sep, "/"))
    return f"surrogate: {{kind: {kind}, data: {table}}}"


def _study(source: Path, kind: str, law: JointLaw, out: Path) -> str:
    """A study with this law; the chain's numbers are placeholders that it says."""
    name = json.dumps(source.stem)
    largest = max((float(side) for side in law.domain.actuation), key=abs)
    key = "pressure" if law.actuation_name == "pressure_pa" else "tendon_force"
    return f"""\
pliant: 1
name: {name}
{_law_line(source, kind, out)}
chain:
  modules: 1                # how many of these joints stand in a row
  module_length: 10 mm      # from one joint to the next
  # module_mass: 1 g        # needed for gravity
  gravity: [0, 0, 0]        # m/s²; [0, 0, -9.81] with a mass
physics: {{kind: quasistatic}}
task: {{kind: free_bending, {key}: {largest:.6g}}}
"""
