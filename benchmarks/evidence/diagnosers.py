"""How the bench asks: `pliant diagnose` and `pliant improve`, with a study and CSVs and nothing else."""

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
    """The JSON of `pliant diagnose STUDY --data CSV …`; it seeds itself."""
    return _command("diagnose", study, data)


def improve(study: str, data: Sequence[str], seed: int) -> dict[str, Any]:
    """The JSON of `pliant improve STUDY --data CSV …`; it seeds itself."""
    with tempfile.TemporaryDirectory() as folder:
        return _command("improve", study, data, "--out", str(Path(folder) / "improved.yaml"))


def load(module: str, verb: str) -> Diagnoser:
    """The function `verb` of a module.

    Raises:
        AttributeError, ImportError: there is none.
    """
    found: Diagnoser = getattr(importlib.import_module(module), verb)
    return found


def _command(verb: str, study: str, data: Sequence[str], *more: str) -> dict[str, Any]:
    """One command in this process, which stays warm from set to set.

    Raises:
        RuntimeError: it ended without a result.
    """
    from pliant.cli.app import main

    with tempfile.TemporaryDirectory() as folder:
        answer = Path(folder) / "answer.json"
        heard = io.StringIO()
        files = [word for csv in data for word in ("--data", csv)]
        arguments = [verb, study, *files, "--json", str(answer), "--quiet", *more]
        with contextlib.redirect_stderr(heard), contextlib.redirect_stdout(heard):
            code = _exit_code(main, arguments)
        if not answer.exists():
            raise RuntimeError(f"pliant {verb} ended with {code}: {heard.getvalue().strip()[-500:]}")
        result: dict[str, Any] = json.loads(answer.read_text())
    return result


def _exit_code(main: Callable[..., Any], arguments: list[str]) -> int:
    before = sys.argv
    sys.argv = ["pliant", *arguments]
    try:
        return int(main() or 0)
    except SystemExit as leaving:
        return int(leaving.code or 0) if not isinstance(leaving.code, str) else 2
    finally:
        sys.argv = before
