"""A session on a small recording of one stated joint with an effect that the study does not contain."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pliant_app.controller import SessionController
from pliant_app.folder import SessionFolder

STUDY = """\
pliant: 1
name: bend
surrogate:
  kind: polynomial
  form: study
  odd: true
  coefficients: {k_n: 1.637e-6, m_a: -1.704e-6, m_e: 0.1012, b_e: 0.0245}
law_error: 0.1 %
chain: {modules: 1, module_length: 80 mm, module_mass: 40 g, gravity: [0, 0, 0]}
physics: quasistatic
task: {kind: free_bending, pressure: 15 kPa}
measurements: {file: bench.csv}
"""


def recording(hidden: float = 1.25, seed: int = 3) -> str:
    """Return six slow runs in three pairs of repeats; the acting pressure is `hidden` times the recorded one."""
    rng = np.random.default_rng(seed)
    lines = ["run,pressure_pa,moment_n_m,angle_rad"]
    for k, top in enumerate([6e3, 6e3, 9e3, 9e3, 12e3, 12e3]):
        for p in np.concatenate([np.linspace(0, top, 20), np.linspace(top, 0, 20)]):
            angle = np.roots([-0.1012 / 2, -(1.704e-6 * hidden * p + 0.0245), 1.637e-6 * hidden * p])
            real = [float(a.real) for a in angle if abs(a.imag) < 1e-12 and a.real >= -1e-12]
            lines.append(f"r{k},{p:.6g},0,{min(real) + 0.002 * rng.standard_normal():.6f}")
    return "\n".join(lines) + "\n"


@pytest.fixture
def bench(tmp_path: Path) -> Path:
    """Return a folder with the study and its recording."""
    (tmp_path / "bend.yaml").write_text(STUDY)
    (tmp_path / "bench.csv").write_text(recording())
    return tmp_path


@pytest.fixture
def controller(bench: Path) -> SessionController:
    """Return the session that `pliant app bend.yaml` opens."""
    made = SessionController(SessionFolder(bench / "session"), bench / "store")
    made.begin(bench / "bend.yaml", [])
    return made
