"""Run exported files in a separate process in which Pliant cannot be imported."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

# The script prints its result in the last line and fails if a module of Pliant was imported.
ENDING = """
import sys as _sys, json as _json
assert not [name for name in _sys.modules if name.startswith("pliant")], "Pliant was imported"
print(_json.dumps(said))
"""


def run_alone(script: str, folder: Path) -> Any:
    """Run a script in `folder` with Python's own path and that folder's; return the value of its variable `said`."""
    file = folder / "run_alone.py"
    file.write_text(script + ENDING)
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    call = subprocess.run(
        [sys.executable, str(file)], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert call.returncode == 0, call.stderr
    return json.loads(call.stdout.splitlines()[-1])
