"""`pliant fit`: a law from a study's data set or from a user's table, or a study's meta-model."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from pliant.cli.options import Overrides, verb
from pliant.cli.session import Session, check_writable, plain
from pliant.config.study import Study
from pliant.errors import MissingDependencyError, UserError
from pliant.pipeline.reported_law import ReportedLaw, fitted_designs, fitted_law
from pliant.pipeline.segments import DesignStages
from pliant.pipeline.study import DEFAULT_SURROGATE, build_study_laws, law_from_table
from pliant.pipeline.workbench import RunContext
from pliant.records.law import JointLaw
from pliant.registry.blame import blamed_on
from pliant.registry.function import package_function
from pliant.report.fit import laws_document, stored_fit_page, table_document
from pliant.store.store import write_atomically

# Endings of files that are read as tables; the reader reports a file that is no table.
TABLES = (".csv", ".txt", ".tsv", ".dat", ".pdf", ".xls", ".xlsx", ".mat", ".parquet", ".lvm", ".asc")

Source = Annotated[
    Path, typer.Argument(metavar="STUDY.yaml|TABLE.csv", help="The study file, or a table from elsewhere.")
]
Kind = Annotated[
    str | None,
    typer.Option(
        "--kind", help="Of a table: the surrogate, polynomial, neural or table; polynomial by default."
    ),
]
Compare = Annotated[
    bool,
    typer.Option(
        "--compare",
        help="Of a table: all installed surrogates side by side; of a meta-model: the published procedure beside it.",
    ),
]
Out = Annotated[
    Path | None,
    typer.Option(
        "--out",
        metavar="DIR",
        help="Where the page goes (fit.html); of a table also a study with this law, of --next its table.",
    ),
]
Learning = Annotated[
    bool,
    typer.Option(help="For the page, fit again to parts of the data: how many states or designs it takes."),
]

STUDY, RESULT = "study.yaml", "fit.json"

Next = Annotated[
    int | None,
    typer.Option(
        "--next",
        metavar="N",
        help="Of a study with a 'meta_model': the N designs to solve next, as next.csv in --out.",
    ),
]


@verb()
def fit(
    session: Session,
    source: Source,
    overrides: Overrides = None,
    kind: Kind = None,
    compare: Compare = False,
    out: Out = None,
    next_designs: Next = None,
    learning: Learning = True,
) -> None:
    """Fit the joint law, or the study's meta-model, to data or any table; prints errors on held-out data."""
    if source.suffix.lower() in TABLES:
        if overrides:
            raise UserError(
                f"'{overrides[0]}' changes a study, and {source} is a table; use --kind, or --out."
            )
        if next_designs is not None:
            raise UserError(f"--next is for a study with a 'meta_model' block, and {source} is a table.")
        fit_table(session, source, kind or DEFAULT_SURROGATE, compare, out, learning)
        return
    loaded = session.study(source, overrides, uses=["sweep"] if next_designs is not None else [])
    swept = loaded.block("meta_model") is not None
    if not swept and next_designs is not None:
        raise UserError(f"--next is for a study with a 'meta_model' block; '{loaded.name}' has none.")
    if swept and kind is None:
        fit_meta_model = package_function("fit_meta_model", "pliant_designs")
        fit_meta_model(session, loaded, next_designs, out, learning, compare)
        return
    if kind is not None or compare:
        name = "--kind" if kind is not None else "--compare"
        hint = f": say 'surrogate.kind={kind}'" if kind is not None else ""
        raise UserError(f"{name} is for a table such as fem.csv, and {source} is a study{hint}.")
    _fit_study(session, loaded, out, learning)


def _fit_study(session: Session, loaded: Study, out: Path | None, learning: bool) -> None:
    """Fit the law of each distinct design of a study; with `out` write the page of the fit."""
    if out is not None:
        check_writable(out)
    context = session.context()
    designs = build_study_laws(context, loaded)
    shown = [d for d in designs if out is not None or d.law.report is not None]
    fitted = fitted_designs(context, shown, learning and out is not None)
    inputs = loaded.canonical()
    document = laws_document(loaded.name, designs, fitted, inputs)
    session.show(document, out, stored_fit_page(context, document, fitted, inputs))


def fit_table(
    session: Session,
    source: Path,
    kind: str,
    compare: bool,
    out: Path | None,
    learning: bool = True,
) -> None:
    """Fit, print, and write what was requested. Raises `UserError` for any error in the table."""
    if out is not None:
        _check_free(source, kind, out)
        check_writable(out)
    context = session.context()
    try:
        stages, own = _fitted(context, source, kind, learning and out is not None)
    except UserError:
        if out is not None and not any(out.iterdir()):
            out.rmdir()
        raise
    fitted, problems = [own], {}
    if compare:
        session.note_left_out("surrogate")
    for other in session.registry.kinds("surrogate") if compare else ():
        try:
            with blamed_on(session.registry.get("surrogate", other), "fit"):
                fitted += [_fitted(context, source, other, False)[1]] if other != kind else []
        except (UserError, MissingDependencyError) as error:
            problems[other] = str(error)
    document = table_document(source, stages, fitted, problems)
    if out is None:
        session.show(document)
        return
    session.result.update(document.data)
    document = replace(document, brief=(*document.brief, _write_study(session, source, kind, own.law, out)))
    session.show(document, out, stored_fit_page(context, document, fitted[:1], {}, fitted))


def _fitted(context: RunContext, source: Path, kind: str, learning: bool) -> tuple[DesignStages, ReportedLaw]:
    stages = law_from_table(context, source, kind)
    config: Any = stages.design.surrogate
    return stages, fitted_law(context, kind, config, stages.law, learning=learning, source=source.name)


def _check_free(source: Path, kind: str, out: Path) -> None:
    """Raise `UserError` where the folder contains a study of another law; a study of this law may have been edited."""
    study = out / STUDY
    if study.exists() and _law_line(source, kind, out) not in study.read_text(
        encoding="utf-8", errors="replace"
    ):
        raise UserError(f"{study} is there already, of another law; give another --out.")


def _write_study(session: Session, source: Path, kind: str, law: JointLaw, out: Path) -> str:
    """Write the study, unless it exists already, and the result; returns the line that reports it."""
    study = out / STUDY
    kept = study.exists()
    if not kept:
        write_atomically(study, _study_text(source, kind, law, out))
    write_atomically(out / RESULT, json.dumps(plain(session.result), indent=1, allow_nan=False) + "\n")
    session.result["study"] = str(study)
    what = "kept as it was;" if kept else "set the chain's measures in it, then"
    return f"study    {study}: {what} 'pliant run {study}'"


def _law_line(source: Path, kind: str, out: Path) -> str:
    """Return the line of the study that names the source of its law."""
    table = json.dumps(os.path.relpath(source, out).replace(os.sep, "/"))
    return f"surrogate: {{kind: {kind}, data: {table}}}"


def _study_text(source: Path, kind: str, law: JointLaw, out: Path) -> str:
    """Return the text of a study with this law; the chain's numbers are placeholders and marked as such."""
    name = json.dumps(source.stem)
    boxes = [[float(side) for side in sides] for sides in law.domain.actuation.reshape(-1, 2)]
    rest = [min(max(0.0, low), high) for low, high in boxes[1:]]  # inputs but the first, nearest to zero
    levels = [f"{value:.6g}" for value in (max(boxes[0], key=abs), *rest)]
    plain = {"pressure_pa": "pressure", "tendon_force_n": "tendon_force"}.get(law.actuation_name)
    inputs = ", ".join(f"{name}: {value}" for name, value in zip(law.actuations, levels, strict=True))
    driven = f"{plain}: {levels[0]}" if plain else f"inputs: {{{inputs}}}"
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
task: {{kind: free_bending, {driven}}}
"""
