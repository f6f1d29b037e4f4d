"""Readers to feed with damaged input, in-process: each returns a value or raises a Pliant error, nothing else."""

from __future__ import annotations

import io
import json
import shutil
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from pliant.config.loading import load_notes, load_study, with_override
from pliant.config.measurements import MeasurementNotes
from pliant.errors import PliantError
from pliant.fem_tables.reading import read_table
from pliant.measurements.files import read_measurements
from pliant.pipeline.run_folder import read_folder
from pliant.registry.component import Component
from pliant.registry.discovery import Registry, discover
from pliant.store.archive import import_archive
from pliant.store.store import CorruptedError, digests, load_artifact, read_checked
from pliant_search.expressions import COMPARISONS, Symbol, parse

ROOT = Path(__file__).parents[2]
OLD = ROOT / "tests/data/of_13594f6"
OWN_ERRORS = (PliantError, CorruptedError)


@dataclass(frozen=True)
class Target:
    """A reader.

    Attributes:
        name: of its finds.
        seeds: sound inputs.
        feed: reads bytes; gets an empty folder too.
    """

    name: str
    seeds: tuple[bytes, ...]
    feed: Callable[[bytes, Path], Any]


@cache
def _registry() -> Registry:
    return discover()


def _study(data: bytes, folder: Path) -> None:
    path = folder / "study.yaml"
    path.write_bytes(data)
    load_study(path, _registry(), note=lambda _: None)


def _override(data: bytes, folder: Path) -> None:
    with_override({"name": "a", "chain": {"modules": 1}, "cross_check": ["a"]}, data.decode("latin-1"))


def _notes(data: bytes, folder: Path) -> None:
    path = folder / "notes.yaml"
    path.write_bytes(data)
    load_notes(path, MeasurementNotes)


def _table(data: bytes, folder: Path) -> None:
    path = folder / "bench.csv"
    path.write_bytes(data)
    read_measurements(path)


def _fem_table(data: bytes, folder: Path) -> None:
    path = folder / "fem.csv"
    path.write_bytes(data)
    read_table(path)


SYMBOLS = {
    "n1": Symbol("n1", "variable"),
    "rmse": Symbol("rmse", "metric", exact=False, unit="m"),
    "family.wall": Symbol("family.wall", "key", exact=False, unit="m"),
    "task.pressure": Symbol("task.pressure", "key", exact=False, unit="Pa"),
    "side": Symbol("side", "variable", sort="text"),
}
VALUES = {"n1": np.array([1.0, 3.0]), "rmse": 1e-3, "family.wall": 1e-3, "task.pressure": 1e4, "side": "left"}


def _expression(data: bytes, folder: Path) -> None:
    text = data.decode("utf-8", "replace")
    known = dict(SYMBOLS)
    expression = parse(text, lambda name: known.get(name, Symbol(name, "key")), "search.constraints.0")
    values = {symbol.name: VALUES.get(symbol.name, 1.0) for symbol in expression.names}
    compares = getattr(expression.tree, "function", "") in (*COMPARISONS, "and")
    expression.amount(values) if compares else expression.value(values)


ARTIFACT = OLD / "store/fit/d01f178d7154ecaafe12ae2c528a2367"
PARTS = ("manifest.json", "value.json", "arrays.npz")


def _artifact(data: bytes, folder: Path) -> None:
    """Read an artifact; the first byte selects the damaged file."""
    place = folder / ARTIFACT.name
    shutil.copytree(ARTIFACT, place)
    (place / PARTS[data[0] % 3 if data else 0]).write_bytes(data[1:])
    load_artifact(place, ARTIFACT.name)


def _resealed(data: bytes, folder: Path) -> None:
    """Read a damaged value with valid checksums, as its author can write them."""
    (folder / "value.json").write_bytes(data)
    shutil.copy(ARTIFACT / "arrays.npz", folder)
    read_checked(folder, digests(folder))


def _run_folder(data: bytes, folder: Path) -> None:
    """Read a run folder; the first byte selects whether run.json or study.json is damaged."""
    place = folder / "run"
    shutil.copytree(OLD / "run", place)
    (place / ("run.json", "study.json")[data[0] % 2 if data else 0]).write_bytes(data[1:])
    read_folder(place, _registry())


def _manifest(data: bytes, folder: Path) -> None:
    """Read a plugin's components from a manifest whose values are any JSON values."""
    try:
        entries = json.loads(data)
        made = [Component(**entry) for entry in entries]
    except (ValueError, TypeError, RecursionError):  # Python's own message to the plugin's author
        return
    for component in made:
        if component.problem() is None:
            component.missing(lazy=True)
            Registry((component,)).by_interface(component.interface)


def _archive(data: bytes, folder: Path) -> None:

    (folder / "study.zip").write_bytes(data)
    inside = folder / "inside"
    inside.mkdir()
    try:
        import_archive(folder / "study.zip", inside / "store", inside / "out")
    finally:
        assert {path.name for path in folder.iterdir()} <= {"study.zip", "inside"}
        assert {path.name for path in inside.iterdir()} <= {"store", "out"}


def _files(*patterns: str) -> tuple[bytes, ...]:
    found = sorted(
        path for pattern in patterns for path in ROOT.glob(pattern) if path.stat().st_size < 20_000
    )
    return tuple(path.read_bytes() for path in found)


BENCH = b"run,time_s,pressure_pa,moment_n_m,angle_rad\n" + b"".join(
    b"r%d,%.1f,%d,0.001,%.4f\n" % (k // 10, 0.1 * (k % 10), 1000 * (k % 10), 0.01 * (k % 10))
    for k in range(30)
)
GERMAN = b"Messung;Zeit [ms];Druck [mbar];Winkel [deg]\n" + b"".join(
    b"a;%d;%d,5;%d,25\n" % (100 * k, 10 * k, k) for k in range(20)
)
EXPRESSIONS = (
    b"n1 + 2 <= 12", b"rmse <= 5 mm and family.wall <= 5 mm", b"side == 'left'",
    b"max(n1, 2) - 0.01 * abs(task.pressure - 12 kPa) / 1 kPa", b"sqrt(n1) ** -2 + sum(n1, sin(n1), log(n1))",
)  # fmt: skip
OVERRIDES = (b"chain.modules=8", b"physics={kind: mujoco}", b"cross_check.0=[a, b]", b"name=a")
NOTES = (b"units: {angle_rad: deg}\nexclude: [{run: a, start: 1 s, end: 2 s}]\n", b"rename: {a: b}\n")
FEM_TABLES = ("examples/data/*.csv", "examples/clamped_chain/module.csv")
MANIFEST = json.dumps(
    [{"interface": "effect", "kind": "leak", "config": "a.b:C", "implementation": "a.b:D", "summary": "s",
      "example": {"x": 1}, "requires": ["numpy"], "lazy": ["scipy.io"], "install": "pip install x"}]
).encode()  # fmt: skip


def _chosen(*parts: bytes) -> tuple[bytes, ...]:
    return tuple(bytes([number]) + part for number, part in enumerate(parts))


def targets() -> list[Target]:
    """Return all readers with their seeds."""
    parts = [(ARTIFACT / name).read_bytes() for name in PARTS]
    run = [(OLD / "run" / name).read_bytes() for name in ("run.json", "study.json")]
    return [
        Target("study", _files("examples/**/*.yaml"), _study),
        Target("override", OVERRIDES, _override),
        Target("notes", NOTES, _notes),
        Target("table", (BENCH, GERMAN, BENCH.decode().encode("utf-16")), _table),
        Target("fem table", _files(*FEM_TABLES), _fem_table),
        Target("expression", EXPRESSIONS, _expression),
        Target("artifact", _chosen(*parts), _artifact),
        Target("value", (parts[1],), _resealed),
        Target("run folder", _chosen(*run), _run_folder),
        Target("manifest", (MANIFEST,), _manifest),
        Target("archive", (_sound_archive(),), _archive),
    ]  # fmt: skip


def _sound_archive() -> bytes:
    """Return a small archive, written by hand as `pliant store --export` writes it."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as made:
        index = {"format": 1, "pliant": "0", "study": "finger", "file": "finger.yaml"}
        made.writestr("archive.json", json.dumps(index))
        made.writestr("study/finger.yaml", (OLD / "finger.yaml").read_bytes())
        for name in PARTS:
            made.writestr(f"store/fit/{ARTIFACT.name}/{name}", (ARTIFACT / name).read_bytes())
    return buffer.getvalue()
