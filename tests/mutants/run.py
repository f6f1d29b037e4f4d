"""Measure whether the tests detect wrong code: each mutant must make one of them fail. `make mutants`

    python -m tests.mutants.run              all mutants; continues an interrupted run
    python -m tests.mutants.run --list       prints them
    python -m tests.mutants.run --room fem   those of one room
    python -m tests.mutants.run --fresh      discards earlier answers

A mutant is written into a copy of the sources, and the tests whose modules import the changed one, the nearest first,
run until one fails. A shipped component is imported by its name only; its conformance test counts as an importer, and
so do the files of its room's tests that write its kind. Answers are kept by the text of the changed file and of those
tests, in .pliant/mutants.json.
Exit code 1 where less than 95 % are caught.
"""

from __future__ import annotations

import argparse
import ast
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import time
from collections import defaultdict
from pathlib import Path

from benchmarks.house import Module, imports, modules
from tests.mutants.chosen import CHOSEN
from tests.mutants.mutant import ROOT, Mutant, drawn

from pliant.registry.component import Component
from pliant_plugins.manifest import pliant_components

SEED, DRAWN = 20, 40
ENOUGH = 0.95
MOST_FILES = 14  # of tests for one mutant
CONFORMANCE = "tests.conformance.test_shipped"
LIMIT_S = 900.0
ANSWERS = ROOT / ".pliant" / "mutants.json"
COPY = ROOT / ".pliant" / "mutants"


def nearest_tests(known: dict[str, Module]) -> dict[str, list[str]]:
    """Return source module → test files, and single tests, that reach it, the nearest first."""
    tests = {}
    for file in sorted((ROOT / "tests").rglob("*.py")):
        name = ".".join(file.relative_to(ROOT).with_suffix("").parts)
        tests[name] = _module(name, file)
    everything = {**known, **tests}
    users: dict[str, set[str]] = defaultdict(set)
    for name, module in everything.items():
        for target in imports(module, everything):
            users[target].add(name)
    for component in pliant_components():
        for place in {component.config.partition(":")[0], component.implementation.partition(":")[0]}:
            users[place] |= _named_by(component, place.split(".")[1])
    for name in known:  # a hook finds the modules of a package that nothing imports
        package = name.partition(".")[0]
        users[f"{package}.manifest"] |= {test for test in tests if test.startswith(f"tests.{package}.test_")}
        if not users[name] and name != f"{package}.manifest":
            users[name].add(f"{package}.manifest")
    return {name: _nearest(name, users) for name in known}


def _module(name: str, file: Path) -> Module:
    return Module(name, "tests", ast.parse(file.read_text(encoding="utf-8")), False)


def _named_by(component: Component, room: str) -> set[str]:
    """Return a component's conformance test, and the files of its room's tests that write its kind."""
    word = re.compile(rf"\b{component.kind}\b")
    files = [
        file for file in (ROOT / "tests" / room).glob("test_*.py") if word.search(file.read_text("utf-8"))
    ]
    return {f"{CONFORMANCE}[{component.interface}-{component.kind}]"} | {
        f"tests.{room}.{file.stem}" for file in files
    }


def _nearest(name: str, users: dict[str, set[str]]) -> list[str]:
    """Return tests by their distance; those named like the module or its room come before others."""
    room, own = set(name.split(".")[1:3]), name.rpartition(".")[2]
    seen, layer, found = {name}, {name}, []
    while layer and len(found) < 4 * MOST_FILES:
        layer = {user for one in layer for user in users[one]} - seen
        seen |= layer
        here = [one for one in sorted(layer) if one.startswith("tests.") and ".test_" in one]
        found += sorted(here, key=lambda one: (own not in one, not room & set(one.split("."))))
    return [_target(one) for one in found[:MOST_FILES]]


def _target(name: str) -> str:
    """Return the pytest argument for a test file's dotted name, or for one case of the conformance test."""
    file, bracket, case = name.partition("[")
    return file.replace(".", "/") + ".py" + (f"::test_shipped[{case}" if bracket else "")


def caught_by(mutant: Mutant, files: list[str]) -> str:
    """Return the test that fails for a mutant; "" where none does."""
    _copy_sources()
    (COPY / mutant.file).write_text(mutant.applied(), encoding="utf-8")
    paths = os.pathsep.join(str(COPY / part) for part in ("core", "plugins"))
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([paths, str(ROOT)]), "OMP_NUM_THREADS": "1"}
    command = [sys.executable, "-m", "pytest", "-x", "-q", "--no-header", "-p", "no:cacheprovider", "-m", ""]
    try:
        for file in files:
            done = subprocess.run(
                [*command, file],
                cwd=ROOT,
                env=environment,
                capture_output=True,
                text=True,
                check=False,
                timeout=LIMIT_S,
            )
            if done.returncode in (1, 2, 3, 4):
                lines = [line for line in done.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
                return lines[0].partition(" - ")[0] if lines else f"{file} ends with {done.returncode}"
    except subprocess.TimeoutExpired:
        return f"{file} does not end"
    finally:
        shutil.copy2(ROOT / mutant.file, COPY / mutant.file)
    return ""


def _copy_sources() -> None:
    """Copy the current sources; unchanged files are kept, so that compiled loops are reused."""
    for part in ("core", "plugins"):
        for file in (ROOT / part).rglob("*"):
            target = COPY / file.relative_to(ROOT)
            if not file.is_file() or "__pycache__" in file.parts:
                continue
            if not target.exists() or target.stat().st_mtime_ns != file.stat().st_mtime_ns:
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(file, target)
        for target in (COPY / part).rglob("*.py"):
            if not (ROOT / target.relative_to(COPY)).exists():
                target.unlink()


def _key(mutant: Mutant, files: list[str]) -> str:
    digest = hashlib.sha256(mutant.applied().encode())
    for file in files:
        digest.update((ROOT / file.partition("::")[0]).read_bytes())
    return digest.hexdigest()[:24]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--list", action="store_true")
    parser.add_argument("--room", default="")
    parser.add_argument("--fresh", action="store_true")
    given = parser.parse_args()
    mutants = [m for m in (*CHOSEN, *drawn(DRAWN, SEED)) if given.room in ("", m.room)]
    for mutant in mutants:
        mutant.applied()  # a chosen place that has moved is reported before hours of work
    if given.list:
        print("\n".join(map(str, mutants)))
        return 0
    tests = nearest_tests(modules())
    answers = json.loads(ANSWERS.read_text()) if ANSWERS.exists() and not given.fresh else {}
    survivors = []
    for number, mutant in enumerate(mutants, 1):
        files = tests[dotted(mutant.file)]
        key = _key(mutant, files)
        if key not in answers:
            begun = time.monotonic()
            answers[key] = caught_by(mutant, files)
            ANSWERS.parent.mkdir(exist_ok=True)
            ANSWERS.write_text(json.dumps(answers, indent=1))
            print(
                f"{number}/{len(mutants)} {mutant}: {answers[key] or 'SURVIVES'} ({time.monotonic() - begun:.0f} s)",
                flush=True,
            )
        if not answers[key]:
            survivors.append(mutant)
    share = 1 - len(survivors) / len(mutants)
    print(f"{len(mutants) - len(survivors)} of {len(mutants)} mutants caught ({100 * share:.1f} %)")
    for mutant in survivors:
        print(f"survives: {mutant}")
    return 0 if share >= ENOUGH else 1


def dotted(file: str) -> str:
    parts = Path(file).with_suffix("").parts[1:]
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


if __name__ == "__main__":
    sys.exit(main())
