"""The user's own comments of an MJCF, kept in the improved file as far as its elements are still there.

MuJoCo writes a specification without comments, in another order. A comment precedes the element that followed
it; where that is not written any more, above the nearest element around it, and at last at the top of the file.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from pliant_mjcf.export.mjcf_text import Key, element_keys

COMMENT, ROOT = ElementTree.Comment, "mujoco"
# Actuators that MuJoCo writes in their general form.
GENERAL = "general"
SHORTCUTS = (
    "motor",
    "position",
    "velocity",
    "intvelocity",
    "damper",
    "cylinder",
    "muscle",
    "adhesion",
    "dcmotor",
)


@dataclass(frozen=True)
class Remembered:
    """A comment, and the elements that it may stand above, the nearest first."""

    words: str
    above: tuple[Key, ...]


def read_comments(file: Path) -> list[Remembered]:
    """Return the comments of a file, in their order; those of files that it includes are not read."""
    builder = ElementTree.TreeBuilder(insert_comments=True)
    parser = ElementTree.XMLParser(target=builder)
    found: list[Remembered] = []
    root = ElementTree.parse(file, parser).getroot()
    _collect(root, (), (), found)
    return found


def placed_comments(comments: Sequence[Remembered], text: str) -> tuple[list[str], list[tuple[Key, str]]]:
    """Return the comments that belong to the top of a written file, and those above one of its elements."""
    there = {key for key in element_keys(text.splitlines()) if key}
    top: list[str] = []
    notes: list[tuple[Key, str]] = []
    for one in comments:
        key = next((key for key in one.above if key in there and key != (ROOT,)), None)
        if key is None:
            top.append(one.words)
        else:
            notes.append((key, one.words))
    return top, notes


def _collect(
    element: ElementTree.Element, path: tuple[str, ...], around: tuple[Key, ...], found: list[Remembered]
) -> None:
    """Add the comments among the children of an element; `path` and `around` are the elements that it is in."""
    own = _own(element)
    here = (*path, own)
    keys = (*_element_keys(path, element), *around)
    children = list(element)
    for k, child in enumerate(children):
        if child.tag is not COMMENT:
            _collect(child, here, keys, found)
            continue
        words = " ".join((child.text or "").split())
        following = next((other for other in children[k + 1 :] if other.tag is not COMMENT), None)
        nearest = () if following is None else _element_keys(here, following)
        if words:
            found.append(Remembered(words, (*nearest, *keys)))


def _own(element: ElementTree.Element) -> str:
    name = element.get("name") or element.get("class")
    return f"{element.tag} {name}" if name else str(element.tag)


def _element_keys(path: tuple[str, ...], element: ElementTree.Element) -> tuple[Key, ...]:
    """Return the key of an element, and that of the form in which MuJoCo may write it."""
    name = element.get("name") or element.get("class")
    if not name:
        return ((*path, _own(element)),)
    general = ((f"{GENERAL} {name}",),) if element.tag in SHORTCUTS else ()
    return ((_own(element),), *general)
