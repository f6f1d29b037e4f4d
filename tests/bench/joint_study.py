"""One bending joint as a study, and protocols of its bench."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pliant_bench.bench import BenchProtocol

STUDY = """\
pliant: 1
name: joint
surrogate:
  kind: polynomial
  form: study
  odd: true
  actuation_name: pressure_pa
  coefficients: {k_n: 1.637e-06, m_a: -1.704e-06, m_e: 0.1012, b_e: 0.0245}
law_error: 0.5 %
chain: {modules: 1, module_length: 80 mm, module_mass: 40 g}
physics: quasistatic
task: {kind: free_bending, pressure: 15 kPa}
"""


def write_study(folder: Path, more: str = "", name: str = "study.yaml") -> Path:
    """Write the study, with more blocks, and return its file."""
    path = folder / name
    path.write_text(STUDY + more)
    return path


def cycles(name: str, top_pa: float, new_specimen: bool = False, **more: dict[str, float]) -> BenchProtocol:
    """Return two cycles of 10 s at 2 Hz from rest to this pressure."""
    clock = 0.5 * np.arange(41)
    pressure = top_pa * (1.0 - np.abs(2.0 * (clock % 10.0) / 10.0 - 1.0))
    return BenchProtocol(
        name, "two cycles", clock, {"pressure_pa": pressure}, new_specimen=new_specimen, **more
    )
