"""A written folder, read again, gives the page of the run in memory."""

from __future__ import annotations

import itertools
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from tests.cli.conftest import STATED as STUDY
from tests.slow import slow_among

from pliant.config.loading import load_study
from pliant.errors import UserError
from pliant.fem_tables.writing import write_table
from pliant.pipeline.run_folder import FinishedRun, finished, read_folder, write_folder
from pliant.pipeline.study import StudyRun, simulate_study
from pliant.pipeline.workbench import RunContext
from pliant.registry.discovery import discover
from pliant.report.document import Page
from pliant.report.render import page as page_of
from pliant.report.run import run_document
from pliant.report.stage import NAMES, write_page
from pliant.store.store import ArtifactStore
from pliant.testing.samples import sample_table, softening_law


def shown(run: FinishedRun) -> Page:
    return page_of(run_document(run))


FITTED = """
name: fitted
surrogate: {kind: polynomial, data: law.csv}
chain: {modules: 3, module_length: 11 mm, gravity: [0, 0, 0]}
task: {kind: free_bending, pressure: 2 kPa}
"""
TWO_DESIGNS = """
name: two
family: {kind: bellow_bending, inner_radius: 2 mm, average_radius: 6 mm, wall: 1.5 mm, module_length: 11 mm}
material: {kind: neo_hookean, shear_modulus: 240 kPa}
surrogate: SURROGATE
chain: {segments: [{modules: 1}, {modules: 2, family: {wall: 1.4 mm}}, {modules: 1, family: {wall: 1.5 mm}}]}
task: {kind: free_bending, pressure: 2 kPa}
"""
TWO_FITTED = TWO_DESIGNS.replace("SURROGATE", "{kind: polynomial, data: law.csv}")
STATED = "{kind: polynomial, form: study, coefficients: {k_n: 1.6e-6, m_a: 0, b_a: 0, m_e: 0.1, b_e: 0.0245}}"
TWO = (TWO_DESIGNS.replace("SURROGATE", STATED), TWO_FITTED)


def run_text(folder: Path, text: str) -> StudyRun:
    rows = [
        f"{p},{u},{1.6e-6 * p - 0.03 * u - 1e-6 * p * u}"
        for p in range(0, 15001, 3000)
        for u in (0, 0.2, 0.4)
    ]
    (folder / "law.csv").write_text("\n".join(["pressure_pa,angle_rad,moment_n_m", *rows]))
    (folder / "study.yaml").write_text(text)
    registry = discover()
    context = RunContext(registry, ArtifactStore(folder / "store"))
    return simulate_study(context, load_study(folder / "study.yaml", registry, ()))


@pytest.mark.parametrize(
    "text",
    [STUDY, *slow_among((FITTED, *TWO), FITTED, *TWO)],
    ids=["stated", "fitted to a table", "two designs, law stated", "two designs, law fitted"],
)
def test_a_folder_carried_elsewhere_gives_the_same_page(tmp_path: Path, text: str) -> None:
    home = tmp_path / "home"
    home.mkdir()
    run = run_text(home, text)
    page = shown(finished(run, {}))
    write_folder(home / "out", run, {})
    elsewhere = tmp_path / "anders wo ü"
    shutil.copytree(home / "out", elsewhere)
    shutil.rmtree(home)
    read = read_folder(elsewhere, discover())
    assert read.segment_designs == run.segment_designs
    again = shown(read)
    assert again.html == page.html
    assert sorted(again.pictures) == sorted(page.pictures)
    assert {re.sub(r"_\d+$", "", name) for name in page.pictures} <= NAMES
    assert text != STUDY or "bends 164.9° at 15\u00a0kPa" in page.html


JUNK = ("", "[]", "7", '"x"', "{}", '{"artifacts": 3}', '{"artifacts": [], "designs": [1], "engines": []}')


def test_a_damaged_folder_is_one_sentence_and_running_again_mends_it(tmp_path: Path) -> None:
    run, out = run_text(tmp_path, FITTED), tmp_path / "out"
    fitted = [(f"data/fit0/{file}", "{") for file in ("value.json", "arrays.npz", "manifest.json")]
    registry = discover()
    for name, text in [*fitted, *itertools.product(["run.json", "study.json"], JUNK)]:
        write_folder(out, run, {})
        assert len(read_folder(out, registry).designs) == 1
        (out / name).write_text(text)
        with pytest.raises(UserError, match="is damaged"):
            read_folder(out, registry)


def test_nothing_from_an_earlier_run_remains(tmp_path: Path) -> None:
    out = tmp_path / "out"
    write_folder(out, run_text(tmp_path, TWO_FITTED), {})
    (out / "notes.txt").write_text("mine")
    (out / "fem_2.csv").write_text("mine")
    write_folder(out, run_text(tmp_path, STUDY), {})
    names = {p.relative_to(out).as_posix() for p in out.rglob("*")}
    assert not any(name.startswith(("data/fit", "data/table")) for name in names)
    assert {"notes.txt", "fem_2.csv", "run.json", "data/simulate0_quasistatic"} <= names


def test_a_folder_half_written_is_no_finished_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run, out = run_text(tmp_path, FITTED), tmp_path / "out"
    write_folder(out, run, {})

    def full(source: Path, target: Path) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr("pliant.pipeline.run_folder._replace_copy", full)
        with pytest.raises(UserError, match="No space left on device"):
            write_folder(out, run, {})
    with pytest.raises(UserError, match="holds no finished run"):
        read_folder(out, discover())


def test_pictures_from_an_earlier_report_go_and_a_users_own_stay(tmp_path: Path) -> None:
    picture = np.zeros(3, np.uint8)
    (tmp_path / "pictures").mkdir()
    (tmp_path / "pictures" / "law_photo.png").touch()
    write_page(tmp_path, "old", dict.fromkeys(["finger", "law", "law_2", "module_shape_2"], picture))
    write_page(tmp_path, "new", dict.fromkeys(["finger", "law"], picture))
    assert {p.name for p in (tmp_path / "pictures").iterdir()} == {"finger.png", "law.png", "law_photo.png"}


UNCERTAIN = """
name: drawn
surrogate: {kind: polynomial, data: law.csv, max_degree: 2}
chain: {modules: 3, module_length: 11 mm, gravity: [0, 0, 0]}
task: {kind: free_bending, pressure: 10 kPa}
uncertainty: {samples: 8}
"""


@pytest.mark.slow
def test_drawn_laws_are_kept_in_the_folder(tmp_path: Path) -> None:
    write_table(sample_table(softening_law(), noise_n_m=1e-4), tmp_path / "law.csv")
    (tmp_path / "study.yaml").write_text(UNCERTAIN)
    registry = discover()
    context = RunContext(registry, ArtifactStore(tmp_path / "store"))
    run = simulate_study(context, load_study(tmp_path / "study.yaml", registry, ()))
    write_folder(tmp_path / "out", run, {})
    again = read_folder(tmp_path / "out", registry)
    assert again.uncertainty is not None and run.uncertainty is not None
    assert np.array_equal(again.uncertainty["tips_m"], run.uncertainty.value["tips_m"])
    page = shown(again)
    assert page.html == shown(finished(run, {})).html and "tip_cloud" in page.pictures
    write_page(tmp_path / "out", page.html, page.pictures)
    assert (tmp_path / "out" / "pictures" / "tip_cloud.png").is_file() and "tip_cloud" in NAMES
    without = load_study(tmp_path / "study.yaml", registry, ["uncertainty=null"])
    write_folder(tmp_path / "out", simulate_study(context, without), {})
    assert read_folder(tmp_path / "out", registry).uncertainty is None
    assert not (tmp_path / "out" / "data" / "uncertainty").exists()
