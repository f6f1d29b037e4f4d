"""The report of a search, one self-contained HTML page from the search's record: answer, course, check, price."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pliant import __version__
from pliant.config.study import Study
from pliant.formatting import units_of_page
from pliant.records.search import SearchResult
from pliant.report.document import Section
from pliant.report.facts import input_table
from pliant.report.folder import FinishedRun
from pliant.report.search_folder import Drawing, DrawnDesign, read_search, write_search
from pliant.report.search_reading import SearchRead
from pliant.report.search_sections import (
    answer_section,
    cost_section,
    drawn_section,
    front_section,
    hero_picture,
    history_section,
    parallel_section,
    policy_section,
    robust_section,
    slopes_section,
    verified_section,
)
from pliant.report.search_words import answer, points, warned
from pliant.report.template import page_template
from pliant.store.store import write_atomically, writing_in

PAGE = "search.html"  # beside report.html, which `pliant run` writes
__all__ = ["DrawnDesign", "rebuild_search_page", "render_search", "write_search_page"]


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


def render_search(study: Mapping[str, Any], result: SearchResult, drawn: Sequence[Drawing] = ()) -> str:
    """The page as HTML with its pictures inside. The same record gives the same bytes.

    Args:
        study: all defaults, SI (`Study.canonical`).
        result: the record.
        drawn: designs to draw.
    """
    read = SearchRead(result, study)
    hero = hero_picture(read)
    made = [
        answer_section(read),
        history_section(read),
        parallel_section(read),
        drawn_section(drawn),
        slopes_section(read),
        verified_section(read),
        robust_section(read),
        policy_section(read),
        front_section(read),
        cost_section(read),
        Section("Inputs", tables=(input_table(FinishedRun({}, study, (), (), ())),)),
    ]
    text: str = page_template().render(
        title=str(study.get("name", "Search")),
        kind="Pliant optimize",
        sentence=answer(read),
        points=points(read),
        hero=hero,
        warnings=warned(read),
        sections=[section for section in made if section is not None],
        version=__version__,
        footer=units_of_page(lengths="m", pressures="Pa", angles="rad"),
    )
    return text


def _write(folder: Path, study: Mapping[str, Any], result: SearchResult, drawn: Sequence[Drawing]) -> Path:
    page = folder / PAGE
    html = render_search(study, result, drawn)
    with writing_in(folder):
        write_atomically(page, html)
    return page
