"""A finished search as a document: the answer, its course, its check and its price, for terminal, page and JSON."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pliant.config.study import Study
from pliant.formatting import units_of_page
from pliant.records.search import SearchResult
from pliant.report import render
from pliant.report.document import Document, Drawn, Section
from pliant.report.provenance import input_table
from pliant.report.search_files import search_json
from pliant.report.search_folder import Drawing, DrawnDesign, read_search, write_search
from pliant.report.search_lines import lines
from pliant.report.search_sentences import answer, points, warned
from pliant.report.search_view import SearchView
from pliant.store.store import write_atomically, writing_in

PAGE = "search.html"  # beside report.html, which `pliant run` writes
__all__ = ["DrawnDesign", "rebuild_search_page", "search_document", "write_search_page"]


def write_search_page(
    folder: Path, study: Study, result: SearchResult, drawn: Sequence[DrawnDesign] = ()
) -> Path:
    """Write `search.html` and the record that `pliant report` rebuilds it from; returns the page's path.

    Args:
        folder: of the search; made where it is not there.
        study: that was searched.
        result: the record.
        drawn: designs to draw, the best first; none leaves their section out.

    Raises:
        UserError: the folder cannot be written.
    """
    drawings = [Drawing.of(one) for one in drawn]
    with writing_in(folder):
        folder.mkdir(parents=True, exist_ok=True)
    write_search(folder, study.canonical(), result, drawings)
    return _write(folder, study.canonical(), result, drawings)


def rebuild_search_page(folder: Path) -> Path:
    """Write `search.html` again from the folder's record; raises `UserError` where there is none."""
    return _write(folder, *read_search(folder))


def search_document(
    study: Mapping[str, Any], result: SearchResult, drawn: Sequence[Drawing] = (), engine: str = ""
) -> Document:
    """The document of `pliant optimize`.

    Args:
        study: all defaults, SI (`Study.canonical`).
        result: the record.
        drawn: designs to draw; none leaves their section out.
        engine: kind of the study's own engine, whose check stands first.
    """
    view = SearchView(result, study)
    return Document(
        kind="Pliant optimize",
        title=str(study.get("name", "Search")),
        sentence=answer(view),
        data=search_json(result, engine),
        brief=tuple(lines(result, engine)) if result.best else (),
        points=tuple(points(view)),
        warnings=tuple(warned(view)),
        draw=lambda: _drawn(view, drawn),
        footer=units_of_page(lengths="m", pressures="Pa", angles="rad"),
    )


def _drawn(view: SearchView, drawn: Sequence[Drawing]) -> Drawn:
    from pliant.report import search_sections as sections  # matplotlib takes a second to import

    made = (
        sections.answer_section(view),
        sections.history_section(view),
        sections.parallel_section(view),
        sections.drawn_section(drawn),
        sections.slopes_section(view),
        sections.verified_section(view),
        sections.robust_section(view),
        sections.policy_section(view),
        sections.front_section(view),
        sections.cost_section(view),
        Section("Inputs", tables=(input_table(view.study),)),
    )
    return Drawn(sections.hero_picture(view), tuple(section for section in made if section is not None))


def _write(folder: Path, study: Mapping[str, Any], result: SearchResult, drawn: Sequence[Drawing]) -> Path:
    page = folder / PAGE
    html = render.page(search_document(study, result, drawn)).html
    with writing_in(folder):
        write_atomically(page, html)
    return page
