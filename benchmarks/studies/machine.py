"""On what a study ran."""

from __future__ import annotations

import os
import platform
from pathlib import Path
from typing import Any

import numpy as np

CPUINFO = Path("/proc/cpuinfo")


def machine() -> dict[str, Any]:
    """Processor, cores, versions, and how busy the machine was in the last minute (processes that wait or run)."""
    return {
        "processor": processor(),
        "cores": os.cpu_count(),
        "system": f"{platform.system()} {platform.release()}",
        "python": platform.python_version(),
        "numpy": np.__version__,
        "load": os.getloadavg()[0] if hasattr(os, "getloadavg") else None,
    }


def processor() -> str:
    """The processor's name, as far as the system tells it."""
    try:
        lines = CPUINFO.read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    names = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(names, "") or platform.processor() or platform.machine()


def machine_words(found: dict[str, Any]) -> str:
    """One line for a page."""
    load = "" if found["load"] is None else f", load {found['load']:.1f} at the start"
    return f"{found['processor']}, {found['cores']} cores, Python {found['python']}{load}"


def state_words(result: dict[str, Any]) -> str:
    """On what a study ran, with which changes, for its page."""
    changes = ", ".join(f"`{override}`" for override in result["overrides"])
    return (
        f"Run on {machine_words(result['machine'])}, with Pliant {result['pliant']}. The reference kernel "
        f"({result['reference_kernel']}) took {1e3 * result['reference_kernel_s']:.0f} ms beside the first search."
        f"{f' Every study was changed: {changes}.' if changes else ''}"
    )
