"""The sections of a search's page: pictures and tables, with a sentence that reads them and says what they hide."""

from __future__ import annotations

from collections.abc import Sequence

from pliant.report.document import Picture, Section, Table
from pliant.report.figures.backbones import backbone_picture
from pliant.report.figures.backbones import caption as backbone_caption
from pliant.report.figures.search_answer import search_answer
from pliant.report.figures.search_designs import search_designs
from pliant.report.figures.search_front import search_front
from pliant.report.figures.search_history import branch_strip, search_history
from pliant.report.figures.search_parallel import search_parallel
from pliant.report.figures.search_policy import search_policy
from pliant.report.figures.search_robust import search_robust
from pliant.report.figures.search_slopes import search_slopes
from pliant.report.figures.search_verified import search_successes, search_verified
from pliant.report.figures.stills import still_pictures
from pliant.report.figures.style import Png
from pliant.report.search_folder import Drawing
from pliant.report.search_sentences import price
from pliant.report.search_tables import (
    branch_table,
    cause_table,
    cost_table,
    design_table,
    robust_table,
    slope_table,
    verified_tables,
)
from pliant.report.search_view import SearchView


def hero_picture(read: SearchView) -> Picture:
    """The best designs in their ranges; the history where there are none."""
    return _picture("search_answer", _answer_caption(read), search_answer(read)) or _history_picture(read)


def _answer_caption(read: SearchView) -> str:
    marks = "Marks are the best designs" if len(read.result.best) > 1 else "The mark is the best design"
    return (
        f"{marks}; each bar is the range that was searched, ticks are whole numbers and choices. A mark at an end of "
        "its bar says that the range, not the physics, may have set it."
    )


def answer_section(read: SearchView) -> Section | None:
    """The best designs in numbers; None where there is none."""
    table = design_table(read)
    if table is None:
        return None
    how = {
        "one": "The best design is the best of those that were tried; nothing shows that no better one exists.",
        "contextual": _contextual_words(read) if read.shape == "contextual" else "",
        "front": "No design of the front is beaten by another in every objective; which one is wanted is not for a "
        "search to say.",
    }[read.shape]
    return Section("The answer", tables=(table,), text=(how,))


def _contextual_words(read: SearchView) -> str:
    if any(design.number < 0 for design in read.result.best):
        return (
            "The optimizer recommends one design for each condition: the middle of what it has learned, which need not "
            "be the best single candidate that it tried."
        )
    if any(design.first for design in read.result.best):
        return "For each condition the best of the few designs that were tried again in it."
    return (
        "For each condition the best of the designs that were tried in it; a lucky trial may have made it so."
    )


def history_section(read: SearchView) -> Section:
    """Candidates in order, and the best of every branch."""
    searches = len(read.result.branches)
    strip = branch_strip(read)
    if read.shape == "none":  # the picture stands at the head of the page
        text = "No candidate is feasible, so there is nothing to learn from it but the causes below."
        return Section("How the search went", text=(text,))
    pictures = [_history_picture(read)]
    if strip is not None:
        caption = f"The best design of each search, sorted by {read.objective.label}; orange is the winner."
        pictures.append(Picture("search_branches", caption, strip))
    text = (
        "A curve that has gone flat says that this optimizer found nothing better from there, not that nothing better "
        "exists."
    )
    if searches > 1:
        text = (
            f"{searches} searches of equal budget, one for each structure. One run of each tells little about "
            "structures whose bests lie close together: another seed may swap them."
        )
    table = branch_table(read)
    return Section("How the search went", tuple(pictures), (table,) if table else (), text=(text,))


def _history_picture(read: SearchView) -> Picture:
    lines = "The lines are the best so far"
    if read.contextual:
        lines = "The lines are moving medians of each condition"
    caption = (
        f"{read.objective.label} of every candidate in the order of evaluation, {read.objective.best_word}. {lines}; "
        "ticks at the upper rim are candidates without an objective (many: shaded by their share), dots at "
        "the edges lie beyond them."
    )
    return Picture("search_history", caption[0].upper() + caption[1:], search_history(read))


def parallel_section(read: SearchView) -> Section | None:
    """All candidates over all variables."""
    caption = (
        f"Each line is a candidate, each row a variable, the last row {read.objective.label}: dark lines are good, the "
        "best is orange. Of many candidates the best tenth (at most 200) and an even choice of the rest are drawn."
    )
    picture = _picture("search_parallel", caption, search_parallel(read))
    if picture is None:
        return None
    text = (
        "Where dark lines meet in one place, good designs agree on that variable. Optimizers try most where they have "
        "found something, so an empty stretch was not tried; it need not be bad."
    )
    return Section("All variables at once", (picture,), text=(text,))


def drawn_section(drawn: Sequence[Drawing]) -> Section | None:
    """The designs as they settle or grasp."""
    caption = "The designs at one scale, as the search's laws settle them."
    if drawn and drawn[0].result.stills:
        caption = (
            "The designs at one scale at the end of their first trial, from the side and from above: outlines of what "
            "collides."
        )
    picture = _picture("search_designs", caption, search_designs(drawn))
    if picture is None:
        return None
    pictures = [picture]
    first = drawn[0]
    if first.result.stills:
        pictures.append(
            Picture("search_stills", f"{first.label}: the first trial.", still_pictures(first.result.stills))
        )
    elif (curves := backbone_picture(first.result)) is not None:
        pictures.append(
            Picture("search_backbones", f"{first.label}: {backbone_caption(first.result)}", curves)
        )
    text = "Drawn from one run of each design with the search's laws; the check tells how far to trust them."
    return Section("The best designs", tuple(pictures), text=(text,))


def slopes_section(read: SearchView) -> Section | None:
    """The objective about the best design."""
    caption = (
        f"{read.objective.title} about the best design (star), one variable changed at a time, the most influential "
        "first. Crosses: no possible design, or it failed. An orange edge is a bound on which the design stands."
    )
    picture = _picture("search_slopes", caption[0].upper() + caption[1:], search_slopes(read))
    if picture is None:
        return None
    table = slope_table(read)
    text = (
        "A steep curve asks for care in manufacture, a flat one leaves freedom. One variable at a time cannot show "
        "what two of them do together."
    )
    return Section("What the objective is sensitive to", (picture,), (table,) if table else (), text=(text,))


def verified_section(read: SearchView) -> Section | None:
    """Predicted against verified; None where nothing was, which the page's notes explain."""
    found = read.result.verification
    if found is None or not found.verified:
        return None
    fem = "by laws fitted to FEM of the design itself" if found.laws else "by a second simulation"
    made = [
        _picture(
            "search_verified",
            f"Metrics as predicted in the search, and {fem}; a row for each engine.",
            search_verified(read),
        ),
        _picture(
            "search_successes",
            "Verified successes by condition and engine; bars are 95 % intervals of counting alone.",
            search_successes(read),
        ),
    ]
    text = (
        "The check replaces the laws of the search; chain, contact and material model stay as they were, so it cannot "
        "show what they leave out. Only a measurement can."
    )
    return Section(
        "Predicted and verified",
        tuple(p for p in made if p is not None),
        tuple(verified_tables(read)),
        text=(text,),
    )


def robust_section(read: SearchView) -> Section | None:
    """Nominal against robust design."""
    found = read.result.robustness
    if found is None:
        return None
    caption = (
        "Both designs in the same scenarios: how many stay up to an objective, and each scenario as a dot with the "
        "median."
    )
    # Of one and the same design there is nothing to compare.
    picture = (
        None if read.result.nominal_is_robust else _picture("search_robust", caption, search_robust(read))
    )
    table = None if read.result.nominal_is_robust else robust_table(read)
    text = f"{price(read)} It holds for what was varied, over {found.samples} draws; what was not varied is not in it."
    return Section(
        "What it costs to be robust", (picture,) if picture else (), (table,) if table else (), text=(text,)
    )


def policy_section(read: SearchView) -> Section | None:
    """Designs by condition."""
    caption = (
        "Designs tried for each condition in the last quarter of the search: dots, 5 to 95 % as a thin line, the "
        "middle half as a thick one. The star is the recommended design."
    )
    picture = _picture("search_policy", caption, search_policy(read))
    if picture is None:
        return None
    text = (
        "Conditions whose spreads part want different designs; a wide spread says that the variable matters little "
        "there, or that the optimizer has not settled yet, and the picture cannot tell which."
    )
    return Section("Which design for which condition", (picture,), text=(text,))


def front_section(read: SearchView) -> Section | None:
    """Several objectives."""
    caption = (
        "Every candidate by its objectives; orange are designs that no other candidate beats in all of them."
    )
    picture = _picture("search_front", caption, search_front(read))
    text = "The front is the best that was found: a longer search can only push it further."
    return Section("The front", (picture,), text=(text,)) if picture is not None else None


def cost_section(read: SearchView) -> Section:
    """What the search took, and why candidates fell out."""
    causes: Table | None = cause_table(read)
    text = "Wall times are those of the machine that searched; the counts are the same on every machine."
    return Section("What it took", tables=(cost_table(read), *((causes,) if causes else ())), text=(text,))


def _picture(name: str, caption: str, png: Png | None) -> Picture | None:
    return None if png is None else Picture(name, caption, png)
