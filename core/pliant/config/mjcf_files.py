"""The files that an MJCF reads, including itself: included files, attached models, meshes, textures, height fields."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

ASSETS = {"mesh": "meshdir", "skin": "meshdir", "texture": "texturedir", "hfield": "meshdir"}


def referenced_files(path: Path, known: tuple[Path, ...] = ()) -> tuple[Path, ...]:
    """Return those files that exist, without models in `known`; the engine reports files that it cannot read."""
    found, trees, folders = [path], list[ElementTree.Element](), dict[str, str]()
    for file in found:  # grows while it is iterated over
        try:
            trees.append(ElementTree.parse(file).getroot())
        except (OSError, ElementTree.ParseError):
            continue
        for compiler in trees[-1].iter("compiler"):
            folders |= {name: value for name, value in compiler.attrib.items() if name.endswith("dir")}
        included = [path.parent / one.get("file", "") for one in trees[-1].iter("include")]
        found += [one for one in dict.fromkeys(included) if one.is_file() and one not in found]
    for tree in trees:
        for element in tree.iter():
            child = path.parent / element.get("file", "")
            if element.tag == "model" and child.is_file():
                seen = (*known, *(one.resolve() for one in found))
                # in the folders that its own compiler element names
                found += referenced_files(child, seen) if child.resolve() not in seen else ()
            if element.tag in ASSETS:
                folder = folders.get(ASSETS[element.tag], folders.get("assetdir", ""))
                names = [value for name, value in element.attrib.items() if name.startswith("file")]
                files = [path.parent / folder / name for name in names]
                found += [one for one in files if one.is_file() and one not in found]
    return tuple(found)
