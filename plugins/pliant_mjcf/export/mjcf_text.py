"""The text of an MJCF with full numbers, comments at what changed, and copies of its meshes and textures."""

from __future__ import annotations

import ctypes
import os
import re
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from difflib import SequenceMatcher
from pathlib import Path
from typing import Any

import mujoco

from pliant_plugins.physics.mujoco.warned import silent

DIGITS = 17  # that give every float back
TAG = re.compile(r"<(/?)([\w]+)([^>]*?)(/?)>")
NAME = re.compile(r'\b(?:name|class)="([^"]*)"')
# How MuJoCo stores a body, without a meaning for its motion.
SIMPLE = ' simple="false"'
LIBRARY = re.compile(r"(lib)?mujoco\.(so|dylib|dll|\d).*")
VALUE = re.compile(r'"([^"]*)"')
# tag and name of an element, or the path to it where it has no name
Key = tuple[str, ...]


def mjcf_text(spec: Any) -> str:
    """Return the MJCF of a compiled specification, every number with as many digits as give it back."""
    with silent(), _all_digits():
        text = str(spec.to_xml())
    return VALUE.sub(lambda match: f'"{_shortest(match[1])}"', text)


def changed_elements(before: str, after: str) -> list[Key]:
    """Return the elements of the second text that the first does not have, or has with other attributes."""
    old, new = ([line.strip() for line in text.replace(SIMPLE, "").splitlines()] for text in (before, after))
    keys = element_keys(new)
    matcher = SequenceMatcher(a=old, b=new, autojunk=False)
    changed = [
        k for tag, _, _, a, b in matcher.get_opcodes() if tag in ("replace", "insert") for k in range(a, b)
    ]
    return list(dict.fromkeys(key for k in changed if (key := keys[k])))


def with_comments(text: str, head: Sequence[str], notes: Sequence[tuple[Key, str]]) -> str:
    """Return the text with comments at the top, and above the elements of these keys."""
    lines = text.splitlines()
    above: dict[int, list[str]] = {}
    keys = element_keys(lines)
    for key, words in notes:
        if key in keys:
            above.setdefault(keys.index(key), []).append(words)
    made: list[str] = []
    for k, line in enumerate(lines):
        indent = line[: len(line) - len(line.lstrip())]
        made += [f"{indent}<!-- {_in_comment(words)} -->" for words in dict.fromkeys(above.get(k, ()))]
        made.append(line)
        if k == 0:
            made += ["  <!--", *(f"    {_in_comment(words)}" for words in head), "  -->", ""]
    return "\n".join(made) + "\n"


def carry_files(spec: Any, source: Path, target: Path) -> tuple[Path, ...]:
    """Copy meshes, height fields, textures and skins into a folder next to the new file; return the copies.

    Files stay where they are if the new MJCF is in the folder of the old one.
    """
    if source.parent.resolve() == target.parent.resolve():
        return ()
    folder = target.with_name(f"{target.stem}_files")
    copies: dict[Path, Path] = {}

    def carried(name: str, kind: str) -> str:
        there = source.parent / kind / (Path(name).name if spec.strippath else name)
        if not name or not there.is_file():
            return name
        if there not in copies:
            taken = {one.name for one in copies.values()}
            own = there.name if there.name not in taken else f"{len(taken)}_{there.name}"
            folder.mkdir(parents=True, exist_ok=True)
            copies[there] = Path(shutil.copyfile(there, folder / own))
        return copies[there].name

    for elements, kind in (
        (spec.meshes, spec.meshdir),
        (spec.hfields, spec.meshdir),
        (spec.skins, spec.meshdir),
        (spec.textures, spec.texturedir),
    ):
        for one in elements:
            one.file = carried(str(one.file), str(kind))
            if hasattr(one, "cubefiles"):
                one.cubefiles = [carried(str(name), str(kind)) for name in one.cubefiles]
    if copies:
        spec.modelfiledir = str(target.parent)
        spec.meshdir = spec.texturedir = os.path.relpath(folder, target.parent)
    return tuple(copies.values())


@contextmanager
def _all_digits() -> Iterator[None]:
    """Let MuJoCo write all digits; it writes six by default, and has no public function for more."""
    files = Path(mujoco.__file__).parent.iterdir()
    library = next((file for file in files if LIBRARY.fullmatch(file.name)), None)
    functions = None if library is None else ctypes.CDLL(str(library))
    change = getattr(functions, "_mjPRIVATE__set_xml_precision", None)
    present = getattr(functions, "_mjPRIVATE__get_xml_precision", None)
    if change is None or present is None:
        yield
        return
    change.argtypes, change.restype, present.restype = [ctypes.c_int], None, ctypes.c_int
    usual = present()
    change(DIGITS)
    try:
        yield
    finally:
        change(usual)


def _shortest(value: str) -> str:
    """Return numbers in their shortest form that gives them back; other values as they are."""
    try:
        numbers = [float(word) for word in value.split()]
    except ValueError:
        return value
    if not any(len(word) > DIGITS - 3 for word in value.split()):
        return value
    return " ".join(repr(one).removesuffix(".0") for one in numbers)


def element_keys(lines: Sequence[str]) -> list[Key]:
    """Return the key of the element that begins in each line of a written MJCF; empty for other lines."""
    found: list[Key] = []
    open_tags: list[str] = []
    for line in lines:
        match = TAG.search(line)
        if match is None or line.lstrip().startswith("<!--"):
            found.append(())
            continue
        closing, tag, attributes, alone = match.groups()
        if closing:
            open_tags.pop()
            found.append(())
            continue
        name = NAME.search(attributes)
        own = f"{tag} {name[1]}" if name else tag
        found.append((*open_tags, own) if not name else (own,))
        if not alone and f"</{tag}>" not in line:
            open_tags.append(own)
    return found


def _in_comment(words: str) -> str:
    """Return words that an XML comment may hold."""
    return words.replace("--", "–").replace("\n", " ").rstrip("-")


def element_words(key: Key) -> str:
    """Return an element in words: ``joint j3``."""
    return " of ".join(reversed(key[-2:])) if " " not in key[-1] and len(key) > 1 else key[-1]
