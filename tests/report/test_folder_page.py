"""A written folder, read again, gives the page that the run in memory gave."""

from __future__ import annotations

from pathlib import Path

from pliant.config.loading import load_study
from pliant.pipeline.study import simulate_study
from pliant.pipeline.workbench import Workbench
from pliant.registry.discovery import discover
from pliant.report.folder import finished, read_folder, write_folder
from pliant.report.page import render
from pliant.store.store import ArtifactStore

STUDY = """
pliant: 1
name: stated
surrogate:
  kind: polynomial
  form: study
  odd: true
  coefficients: {k_n: 1.637e-6, m_a: -1.704e-6, b_a: 0, m_e: 0.1012, b_e: 0.0245}
chain: {modules: 8, module_length: 11 mm, gravity: [0, 0, 0]}
task: {kind: free_bending, pressure: 15 kPa}
"""


def test_folder_gives_the_same_page(tmp_path: Path) -> None:
    (tmp_path / "study.yaml").write_text(STUDY)
    registry = discover()
    bench = Workbench(registry, ArtifactStore(tmp_path / "store"))
    run = simulate_study(bench, load_study(tmp_path / "study.yaml", registry, ()))
    page = render(finished(run, {"unused": []}))
    write_folder(tmp_path / "out", run, {"unused": []})
    again = render(read_folder(tmp_path / "out", registry))
    assert again.html == page.html
    assert "bends 164.9° at 15\u00a0kPa" in page.html
