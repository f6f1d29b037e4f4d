"""The end of every page: the study's inputs, and the provenance of each artifact."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from pliant import __version__
from pliant.formatting import Unit, field_stem_and_unit, number, seconds
from pliant.report.document import Cells, Section, Table
from pliant.store.store import Artifact

Manifests = Sequence[Mapping[str, Any]]


def closing_sections(study: Mapping[str, Any], manifests: Manifests) -> list[Section]:
    """Return inputs, then provenance if there is any."""
    sections = [Section("Inputs", tables=(input_table(study),))]
    if manifests:
        sections.append(Section("Provenance", tables=(provenance_table(manifests),)))
    return sections


def input_table(study: Mapping[str, Any]) -> Table:
    """Return the study with all defaults, in readable units, one row per block."""
    rows: list[Cells] = []
    for key, value in study.items():
        for block in value if isinstance(value, list) else [value]:
            texts = [f"{name} {text}".strip() for name, text in _inputs(block)]
            if key != "pliant" and texts:
                rows.append([words(key), " · ".join(texts)])
    return Table("Inputs", ["block", "values, defaults included"], rows, numeric=9)


def provenance_table(manifests: Manifests) -> Table:
    """Return stage, key, time, code and versions of every artifact."""
    rows = []
    for m in manifests:
        libraries = {**m.get("libraries", {}), **m.get("versions", {})}
        packages = dict.fromkeys(str(plugin.get("package", "")) for plugin in m.get("plugins", ()))
        foreign = [package for package in packages if package and package.partition(" ")[0] != "pliant"]
        rows.append(
            [
                stage_name(m),
                str(m.get("key", ""))[:12],
                str(m.get("created", "")).replace("T", " ").replace("+00:00", " UTC"),
                seconds(float(m["wall_s"])),
                str(m.get("code", ""))[:12],
                f"pliant {m.get('pliant', '?')}, Python {m.get('python', '?')}, "
                + ", ".join([*foreign, *(f"{name} {version}" for name, version in libraries.items())]),
                str(m.get("platform", "")),
            ]
        )
    head = ["stage", "key", "computed", "wall time", "code", "versions", "platform"]
    note = "Key: hash of config, inputs, code and library versions. Code: fingerprint of the sources it depends on."
    return Table("Provenance", head, rows, note, numeric=9)


def made_by(manifests: Manifests) -> str:
    """Return the version of Pliant that made the first artifact; this one without artifacts."""
    return str(manifests[0].get("pliant", __version__)) if manifests else __version__


def stage_name(manifest: Mapping[str, Any]) -> str:
    """Return the stage, with its engine if it has one."""
    physics = (manifest.get("config") or {}).get("physics") or {}
    kind = f" ({physics['kind']})" if "kind" in physics else ""
    return f"{manifest.get('stage', '?')}{kind}"


def stage_json(artifact: Artifact) -> dict[str, Any]:
    """Return the provenance of a result, for JSON."""
    manifest = artifact.manifest
    return {
        "stage": manifest["stage"],
        "key": artifact.key,
        "cached": artifact.cached,
        "wall_s": manifest["wall_s"],
    }


def duration(artifact: Artifact, wall_s: float | None = None) -> str:
    """Return the time of the stage, or of the given part of it, and whether it came from the store."""
    text = seconds(float(artifact.manifest["wall_s"] if wall_s is None else wall_s))
    return f"{text}, from the store" if artifact.cached else text


def words(name: str) -> str:
    """Return a key as words."""
    return name.replace("_", " ")


def plain(value: Any) -> str:
    """Return a value without a unit, lists in brackets."""
    if isinstance(value, list | tuple):
        return "[" + ", ".join(plain(v) for v in value) + "]"
    return number(value, 5) if isinstance(value, int | float) else str(value)


def nested(value: Any, leaf: Callable[[Any], str]) -> str:
    """Return lists and named values as one text, each value written by `leaf`."""
    if isinstance(value, list | tuple):
        return ", ".join(nested(item, leaf) for item in value)
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {nested(item, leaf)}" for name, item in value.items())
    return leaf(value)


def short_text(value: Any) -> str:
    """Return a value in a few words; empty for more than one value, a short list or a few named numbers."""
    if isinstance(value, bool | float | int):
        return number(value, 3)
    if isinstance(value, str):
        return words(value)
    if isinstance(value, Mapping) and all(isinstance(v, float | int) for v in value.values()):
        return ", ".join(f"{words(str(key))} {number(v, 3)}" for key, v in value.items())
    if isinstance(value, list | tuple) and len(value) <= 8 and all(isinstance(v, float | int) for v in value):
        return ", ".join(number(v, 3) for v in value)
    return ""


def _inputs(value: Any, key: str = "") -> Iterator[tuple[str, str]]:
    """Yield names and texts of a block's values, without unset ones."""
    if value is None or value == [] or value == {}:
        return
    if isinstance(value, Mapping) and key != "coefficients":
        for inner, item in value.items():
            yield from _inputs(item, f"{key} {inner}".strip())
    elif isinstance(value, list) and any(isinstance(item, Mapping) for item in value):
        for count, item in enumerate(value):
            yield from _inputs(item, f"{key} {count + 1}".strip())
    else:
        label, unit = field_stem_and_unit(key)
        yield ("" if key == "kind" else words(label)), _quantity(value, unit)


def _quantity(value: Any, unit: Unit) -> str:
    if isinstance(value, bool):
        return number(value)
    if isinstance(value, str):  # a report neither depends on nor reveals the folders of its files
        return Path(value).name if os.path.isabs(value) else value  # noqa: PTH117 - a text
    if isinstance(value, Mapping):
        return "; ".join(f"{k} = {plain(v)}" for k, v in value.items())
    if isinstance(value, list | tuple):
        inner = ", ".join(plain(v * unit.factor) if isinstance(v, float | int) else str(v) for v in value)
        return f"({inner}) {unit.symbol}".strip()
    return unit.text(value, 6) if unit.symbol else number(value, 6)
