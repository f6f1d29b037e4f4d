"""A study with methods, and results with a notebook representation."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
from tests.cli.conftest import STATED as JOINTS

import pliant
from pliant.errors import UserError
from pliant.notebook.study import StudyHandle

EXAMPLES = Path(__file__).parents[2] / "examples"
# eight stated joints at 15 kPa without gravity (docs/conventions.md): every joint at 0.359718 rad
STUDY = f"{JOINTS}measurements: {{file: bench.csv}}\n"


@pytest.fixture
def stated(tmp_path: Path) -> StudyHandle:
    (tmp_path / "study.yaml").write_text(STUDY)
    pressure = np.linspace(0.0, 15e3, 16)
    rows = [f"{run},{k},{p:.1f},{8 * 2.4e-5 * p:.6f}" for run in "ab" for k, p in enumerate(pressure)]
    (tmp_path / "bench.csv").write_text("run,time_s,pressure_pa,angle_rad\n" + "\n".join(rows) + "\n")
    return pliant.open(tmp_path / "study.yaml", store=tmp_path / "store")


def test_the_worked_number_in_the_conventions_is_reproduced(stated: StudyHandle) -> None:
    done = stated.simulate()
    assert done.tip == pytest.approx([0.059451, 0.0, -0.007889], abs=1e-6)
    assert done.joint_angles == pytest.approx(0.359718, abs=1e-6)
    assert done.converged
    assert done.metrics["tip_x_m"] == pytest.approx(done.tip[0])
    assert done.law.evaluate(np.array([15e3]), np.array([[0.359718]])).tau == pytest.approx(0.0, abs=1e-7)


def test_a_changed_study_is_another_one(stated: StudyHandle) -> None:
    shorter = stated.with_(chain={"modules": 4}, pressure="10 kPa")
    assert shorter.config.chain.modules == 4
    assert shorter.config.task.pressure_pa == 10e3
    assert stated.config.chain.modules == 8
    assert shorter.with_({"task.pressure": "5 kPa"}).config.task.pressure_pa == 5e3
    assert len(shorter.simulate().markers) == 4 + 2


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"presure": "10 kPa"}, "did you mean 'pressure'"),
        ({"kind": "mujoco"}, "no block"),
        ({"pressure": "10 apples"}, "apples"),
    ],
)
def test_a_wrong_change_is_one_sentence(stated: StudyHandle, changes: dict[str, str], words: str) -> None:
    with pytest.raises(UserError, match=words):
        stated.with_(changes)


def test_a_name_that_several_blocks_have_is_asked_for(stated: StudyHandle) -> None:
    loaded = stated.with_(task={"kind": "tip_load", "pressure": "15 kPa", "payload": "1 g"})
    with pytest.raises(UserError, match=r"chain\.payload.*task\.payload"):
        loaded.with_(payload="2 g")


def test_results_show_themselves(stated: StudyHandle) -> None:
    for result in (stated.simulate(), stated.compare()):
        assert "\n" not in repr(result)
        assert len(repr(result)) < 170
        assert result.document.sentence[:20] in result._repr_html_()
        axes = plt.figure().add_subplot()
        assert result.plot(axes) is axes
        assert axes.lines
        assert len(result.to_frame()) > 0
        plt.close("all")
    assert stated.simulate().to_frame()["z_m"].iloc[-1] == pytest.approx(-0.007889, abs=1e-6)
    compared = stated.compare()
    frame = compared.to_frame()
    assert list(frame.columns) == ["run", "time_s", "output", "measured", "predicted", "residual"]
    rms = float(np.sqrt((frame["residual"] ** 2).mean()))
    assert compared.outputs["angle_rad"].rmse == pytest.approx(rms)
    assert compared.json["outputs"]["angle_rad"]["rmse"] == pytest.approx(rms)


def test_a_saved_result_is_the_command_page(stated: StudyHandle, tmp_path: Path) -> None:
    page = stated.simulate().save(tmp_path / "page")
    assert page.name == "report.html"
    assert "data:image/png" in page.read_text(encoding="utf-8")


def test_markup_in_a_name_is_text_in_a_notebook(stated: StudyHandle, tmp_path: Path) -> None:
    text = (tmp_path / "bench.csv").read_text().replace("\na,", "\n<b>a</b>,")
    (tmp_path / "bench.csv").write_text(text)
    assert "<b>a</b>" not in stated.compare()._repr_html_()


def test_a_law_from_a_frame_equals_that_from_its_file(tmp_path: Path) -> None:
    pandas = pytest.importorskip("pandas")
    p, u = (grid.ravel() for grid in np.meshgrid(np.linspace(0, 15e3, 6), np.linspace(-0.2, 0.6, 7)))
    table = {
        "pressure_pa": p,
        "angle_rad": u,
        "moment_n_m": 1.6e-6 * p - 1e-6 * p * u - 0.03 * u - 0.01 * u**2,
    }
    frame = pandas.DataFrame(table)
    frame.to_csv(tmp_path / "table.csv", index=False)
    fits = [pliant.fit(data, store=tmp_path / "store") for data in (frame, tmp_path / "table.csv")]
    at = (np.array([7e3]), np.array([[0.3]]))
    first, second = (one.law.evaluate(*at).tau for one in fits)
    assert first == pytest.approx(second, abs=1e-15)
    assert first == pytest.approx(1.6e-6 * 7e3 - 1e-6 * 7e3 * 0.3 - 0.03 * 0.3 - 0.01 * 0.09, abs=1e-9)
    assert set(fits[0].to_frame().columns) >= {"pressure_pa", "angle_rad", "moment_n_m"}


@pytest.mark.slow
def test_an_improved_study_is_written_and_reads_again(tmp_path: Path) -> None:
    joint = pliant.open(EXAMPLES / "hidden_effect" / "finger.yaml", store=tmp_path / "store")
    found = joint.improve(effects=["viscoelastic", "stiffness"], out=tmp_path / "better.yaml")
    better = pliant.open(tmp_path / "better.yaml", store=tmp_path / "store")
    assert [effect.kind for effect in better.config.effects] == ["viscoelastic"]
    assert better.compare().rmse_over_floor < joint.compare().rmse_over_floor / 2
    assert found.steps[-1].added == ("viscoelastic",)


def test_a_recording_is_taken_as_files_as_it_was_read_and_as_a_frame(stated: StudyHandle) -> None:
    file = stated.path.with_name("bench.csv")
    read = pliant.read(file)
    errors = [
        stated.compare(data).outputs["angle_rad"].rmse
        for data in (None, file, [file], read, read.record, read.to_frame())
    ]
    assert errors == pytest.approx([errors[0]] * len(errors), rel=1e-9)
    new = stated.path.with_name("new.yaml")
    for unnamed in (read.to_frame(), [read.to_frame()], pliant.read(file, sigma={"angle_rad": "1 deg"})):
        with pytest.raises(UserError, match="give 'data' as paths"):
            stated.extend("stiffness", data=unnamed, out=new)
        assert not new.exists()
    found = stated.extend("stiffness", data=read, out=new)
    (written,) = pliant.open(new).config.effects
    assert written.kind == "stiffness" and written.factor == pytest.approx(found.effects[0].factor, rel=1e-2)
