"""A diagnoser for tests of the bench: it answers from the CSV's size alone, slowly enough to be killed."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any


def diagnose(study: str, data: Sequence[str], seed: int) -> dict[str, Any]:
    """Return stiffness always; fail where a label is visible, and end the process at one set if requested."""
    assert Path(study).suffix == ".yaml" and "kind: polynomial" in Path(study).read_text()
    assert Path(data[0]).read_text().startswith("run,specimen,time_s,pressure_pa")
    if os.environ.get("STAND_IN_DIES_AT") == Path(study).name.removesuffix("_study.yaml"):
        os._exit(1)
    time.sleep(float(os.environ.get("STAND_IN_SECONDS", "0")))
    return {
        "verdict": "missing_effect",
        "selected": ["stiffness"],
        "hypotheses": [{"kinds": ["stiffness"], "probability": 0.9}, {"kinds": [], "probability": 0.1}],
        "credible_set": [{"kinds": ["stiffness"], "probability": 0.9}],
    }
