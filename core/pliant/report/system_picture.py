"""The part of a page that shows a user's own model, and where effects act in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from pliant.errors import UserError
from pliant.evidence.driven_model import DrivenModel
from pliant.evidence.measured_model import MeasuredModel
from pliant.interfaces.effect import AT
from pliant.interfaces.model import SystemEffect, SystemPicture
from pliant.report.document import Document, Drawn, Picture, Section, Table

if TYPE_CHECKING:
    from pliant.report.figures.style import Png

MOST_MARKED = 8  # places of one effect
COLUMN_PX, LINE_PX = 380, 24  # of the labels beside the picture
TITLE = "Where it acts"
PLACES = {
    "input": "inputs",
    "output": "outputs",
    "joint": "joints",
    "tendon": "tendons",
    "body": "bodies",
    "world": "the world",
    "parameter": "parameters",
    "state": "the state",
}


@dataclass(frozen=True)
class Acting:
    """An effect and the places where it acts."""

    kind: str
    place: str
    names: tuple[str, ...]

    @property
    def words(self) -> str:
        """Return the places in words: ``joints: elbow, wrist``."""
        names = ", ".join(self.names[:MOST_MARKED]) + (", …" if len(self.names) > MOST_MARKED else "")
        return PLACES.get(self.place, self.place) + (f": {names}" if self.place != "world" else "")


def with_system(document: Document, model: MeasuredModel, kinds: Sequence[str]) -> Document:
    """Return the document with a section on where effects of these kinds act; of a chain, the document itself."""
    if not isinstance(model, DrivenModel):
        return document
    acting = _acting(model, kinds)

    def drawn() -> Drawn:
        made = document.draw()
        section = _section(model, acting)
        # behind what the page is about
        parts = made.sections if section is None else (*made.sections[:1], section, *made.sections[1:])
        return replace(made, sections=parts)

    return replace(document, draw=drawn)


def system_still(model: MeasuredModel, kinds: Sequence[str]) -> bytes | None:
    """Return the picture of the model with the places of these kinds as PNG bytes; None of a chain, or without one."""
    if not isinstance(model, DrivenModel):
        return None
    section = _section(model, _acting(model, kinds))
    if section is None or not section.pictures:
        return None
    return bytes(section.pictures[0].png)


def _acting(model: DrivenModel, kinds: Sequence[str]) -> list[Acting]:
    """Return the places of each effect; effects of which nothing is known are left out."""
    found = []
    for kind in dict.fromkeys(kinds):
        component = next(
            (
                one
                for one in model.context.registry.by_interface("effect")
                if one.kind == kind.partition(AT)[0]
            ),
            None,
        )
        if component is None:
            continue
        effect = component.build(component.config_model()(kind=kind, **component.smallest_block()))
        if isinstance(effect, SystemEffect):
            try:
                found.append(
                    Acting(kind, effect.place, effect.chosen(model.attachments.get(effect.place, ())))
                )
            except UserError:  # a pattern of a study that another model replaced
                continue
    return found


def _section(model: DrivenModel, acting: Sequence[Acting]) -> Section | None:
    marked = [(one.kind, one.place, name) for one in acting for name in one.names[:MOST_MARKED]]
    seen = model.system.picture([(place, name) for _, place, name in marked])
    rows = [[one.kind, one.words] for one in acting]
    table = (Table("", ["effect", "acts at"], rows),) if rows else ()
    if seen is None and not table:
        return None
    pictures: tuple[Picture, ...] = ()
    if seen is not None:
        caption = "The model at rest. " + ("Marked: where the effects act." if any(seen.places) else "")
        pictures = (Picture("system", caption.strip(), _still(seen, marked)),)
    return Section(TITLE if acting else "The model", pictures, table, open=bool(acting))


def _still(seen: SystemPicture, marked: Sequence[tuple[str, str, str]]) -> Png:
    """Return the picture as PNG bytes, with rings and labels at the places."""
    from pliant.report.chart_colours import INK, PAPER, SOFT, WARN
    from pliant.report.figures import style  # matplotlib takes a second to import

    height, width = seen.pixels.shape[:2]
    labels: dict[tuple[float, float], list[str]] = {}
    for (kind, _, name), at in zip(marked, seen.places, strict=True):
        if at is not None:
            known = labels.setdefault(at, [])
            known.append(kind if kind.endswith(f"{AT}{name}") else f"{kind} ({name})")
    whole = width + (COLUMN_PX if labels else 0)
    with style.canvas(whole, height, pad=None) as figure:
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.set_axis_off()
        axes.imshow(seen.pixels, interpolation="nearest", aspect="equal")
        places = sorted(labels, key=lambda at: at[1])
        rows = _apart([at[1] for at in places], [LINE_PX * (0.6 + len(labels[at])) for at in places], height)
        for at, row in zip(places, rows, strict=True):
            axes.plot((at[0], width), (at[1], row), color=PAPER, lw=2.6)
            axes.plot((at[0], width), (at[1], row), color=SOFT, lw=0.9)
            axes.plot(*at, "o", ms=12, mfc=PAPER, mec=PAPER, mew=4.0)
            axes.plot(*at, "o", ms=12, mfc="none", mec=WARN, mew=2.2)
            axes.text(width + 8, row, "\n".join(labels[at]), color=INK, ha="left", va="center", fontsize=9.0)
        axes.set(xlim=(0, whole), ylim=(height, 0))
        return style.small_png(figure)


def _apart(rows: Sequence[float], heights: Sequence[float], most: float) -> list[float]:
    """Return ascending rows of labels near the wanted ones, moved so that labels of these heights do not overlap."""
    found: list[float] = []
    for k, (row, height) in enumerate(zip(rows, heights, strict=True)):
        least = found[-1] + 0.5 * (heights[k - 1] + height) if found else 0.5 * height
        found.append(max(row, least))
    end = most
    for k in range(len(found) - 1, -1, -1):
        found[k] = min(found[k], end - 0.5 * heights[k])
        end = found[k] - 0.5 * heights[k]
    return found
