"""Runs what was exported in a process of its own, where Pliant is not to be found."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

# What the script says in its last line; and that no module of Pliant was there.
ENDING = """
import sys as _sys, json as _json
assert not [name for name in _sys.modules if name.startswith("pliant")], "Pliant was imported"
print(_json.dumps(said))
"""


def run_alone(script: str, folder: Path) -> Any:
    """What a script leaves in `said`, run in `folder` with Python's own path and that folder's."""
    file = folder / "run_alone.py"
    file.write_text(script + ENDING)
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    call = subprocess.run(
        [sys.executable, str(file)], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert call.returncode == 0, call.stderr
    return json.loads(call.stdout.splitlines()[-1])
