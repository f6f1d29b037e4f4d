"""Calls of the diagnosis by the bench: `pliant diagnose` and `pliant improve`, with only a study and CSVs."""

from __future__ import annotations

import contextlib
import importlib
import io
import json
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

Diagnoser = Callable[[str, Sequence[str], int], dict[str, Any]]
DEFAULT = "benchmarks.evidence.diagnosers"


def diagnose(study: str, data: Sequence[str], seed: int) -> dict[str, Any]:
    """Return the JSON of `pliant diagnose STUDY --data CSV … --no-page`; it seeds itself."""
    return _command("diagnose", study, data, "--no-page")


def improve(study: str, data: Sequence[str], seed: int) -> dict[str, Any]:
    """Return the JSON of `pliant improve STUDY --data CSV …`, which seeds itself."""
    with tempfile.TemporaryDirectory() as folder:
        return _command("improve", study, data, "--out", str(Path(folder) / "improved.yaml"))


def load(module: str, verb: str) -> Diagnoser:
    """Return the function `verb` of a module.

    Raises:
        AttributeError, ImportError: it does not exist.
    """
    return getattr(importlib.import_module(module), verb)


def _command(verb: str, study: str, data: Sequence[str], *more: str) -> dict[str, Any]:
    """Run one command in this process, which stays warm from set to set.

    Raises:
        RuntimeError: it ended without a result.
    """
    from pliant.cli.app import main

    with tempfile.TemporaryDirectory() as folder:
        answer = Path(folder) / "answer.json"
        heard = io.StringIO()
        files = [word for csv in data for word in ("--data", csv)]
        arguments = [verb, study, *files, "--json", str(answer), "--quiet", *more]
        before, sys.argv, code = sys.argv, ["pliant", *arguments], None
        try:
            with contextlib.redirect_stderr(heard), contextlib.redirect_stdout(heard):
                code = main()
        except SystemExit as leaving:
            code = leaving.code
        finally:
            sys.argv = before
        if not answer.exists():
            raise RuntimeError(f"pliant {verb} ended with {code}: {heard.getvalue().strip()[-500:]}")
        result: dict[str, Any] = json.loads(answer.read_text())
    return result
