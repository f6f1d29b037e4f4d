"""`pliant fit`: a law from a study's data set, or from a table of anybody's."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pliant.cli.fit_meta import Next, fit_meta
from pliant.cli.fit_table import fit_table
from pliant.cli.options import DEFAULT_STORE, JsonFile, Overrides, Quiet, StoreFolder
from pliant.cli.session import Session, check_writable, session
from pliant.config.study import Study
from pliant.errors import UserError
from pliant.pipeline.study import DEFAULT_SURROGATE, laws_of_study
from pliant.report.fit import fitted_designs, laws_document, stored_fit_page

# Endings of what is meant as a table; those that are none are told so when they are read.
TABLES = (".csv", ".txt", ".tsv", ".dat", ".pdf", ".xls", ".xlsx")

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
        help="Of a table: all installed surrogates side by side; of a meta-model: the study's way beside it.",
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


def fit(
    source: Source,
    overrides: Overrides = None,
    kind: Kind = None,
    compare: Compare = False,
    out: Out = None,
    next_designs: Next = None,
    learning: Learning = True,
    store: StoreFolder = DEFAULT_STORE,
    json: JsonFile = None,
    quiet: Quiet = False,
) -> None:
    """The joint law, or the study's meta-model, from data or anybody's table; prints errors on what was left out."""
    with session("fit", json, quiet) as here:
        if source.suffix.lower() in TABLES:
            if overrides:
                raise UserError(
                    f"'{overrides[0]}' changes a study, and {source} is a table; use --kind, or --out."
                )
            if next_designs is not None:
                raise UserError(f"--next is for a study with a 'meta_model' block, and {source} is a table.")
            fit_table(here, source, kind or DEFAULT_SURROGATE, compare, out, store, learning)
            return
        loaded = here.study(source, overrides, uses=["sweep"] if next_designs is not None else [])
        if loaded.meta_model is None and next_designs is not None:
            raise UserError(f"--next is for a study with a 'meta_model' block; '{loaded.name}' has none.")
        if loaded.meta_model is not None and kind is None:
            fit_meta(here, loaded, next_designs, out, store, learning, compare)
            return
        if kind is not None or compare:
            name = "--kind" if kind is not None else "--compare"
            hint = f": say 'surrogate.kind={kind}'" if kind is not None else ""
            raise UserError(f"{name} is for a table such as fem.csv, and {source} is a study{hint}.")
        _fit_study(here, loaded, out, store, learning)


def _fit_study(here: Session, loaded: Study, out: Path | None, store: Path, learning: bool) -> None:
    """The law of each distinct design of a study; with `out` the page of the fit."""
    if out is not None:
        check_writable(out)
    bench = here.bench(store)
    designs = laws_of_study(bench, loaded)
    shown = [d for d in designs if out is not None or d.law.report is not None]
    fitted = fitted_designs(bench, shown, learning and out is not None)
    inputs = loaded.canonical()
    document = laws_document(loaded.name, designs, fitted, inputs)
    here.show(document, out, stored_fit_page(bench, document, fitted, inputs))
