"""`pliant render` and `pliant view`: files are complete or absent; wrong input is reported before any computation."""

import json
import shutil

import numpy as np
import pytest

pytest.importorskip("mujoco")
from PIL import Image
from tests.cli.conftest import STATED as JOINTS

from pliant.errors import MissingDependencyError
from pliant_view import films

STATED = JOINTS.replace("length: 11 mm,", "length: 11 mm, module_radius: 6 mm,")
SMALL = ("--size", "96x64")


@pytest.fixture
def study(write):
    return write(STATED)


def drawn(call):
    """Return the call's result, or skip where this machine has no OpenGL."""
    if call.code == 2 and "OpenGL" in call.err:
        pytest.skip(call.err)
    return call


def test_a_picture(pliant, study, read):
    call = drawn(
        pliant("render", study, "--out", "tip.png", *SMALL, "--camera", "front", "--json", "r.json")
    ).done()
    assert "written  tip.png" in call.out
    assert Image.open("tip.png").size == (96, 64)
    result = read("r.json")
    assert result["out"] == "tip.png"
    assert result["pictures"] == 1


@pytest.mark.slow
def test_the_picture_instant(pliant, study):
    for name, more in (("start", ["--time", "0"]), ("end", ["--time", "1"]), ("last", [])):
        drawn(pliant("render", study, "--out", f"{name}.png", *SMALL, *more))
    start, end, last = (np.array(Image.open(f"{name}.png")) for name in ("start", "end", "last"))
    np.testing.assert_array_equal(end, last)
    assert np.mean(start != end) > 0.01


@pytest.mark.slow
def test_the_end_is_the_end_within_half_a_frame(pliant, study):
    """Frames of a scene end a rounding error before 6 s; the eleven levels here end at 1."""
    drawn(pliant("render", study, "--out", "after.png", *SMALL, "--time", "1.04")).done()
    drawn(pliant("render", study, "--out", "last.png", *SMALL))
    np.testing.assert_array_equal(*(np.array(Image.open(f"{name}.png")) for name in ("after", "last")))


@pytest.mark.slow
def test_a_gif_is_as_long_as_the_motion(pliant, study):
    drawn(pliant("render", study, "--out", "bend.gif", *SMALL, "--fps", "10"))
    film = Image.open("bend.gif")
    assert film.n_frames == 11  # a ramp is parametrised from 0 to 1
    total = 0
    for frame in range(film.n_frames):
        film.seek(frame)
        total += film.info["duration"]
    assert total == pytest.approx(1100, abs=10)


@pytest.mark.slow
def test_the_film_length_may_be_given(pliant, study):
    drawn(pliant("render", study, "--out", "bend.gif", *SMALL, "--fps", "5", "--seconds", "2"))
    assert Image.open("bend.gif").n_frames == 11


@pytest.mark.slow
def test_an_mp4_plays(pliant, study):
    try:
        films._ffmpeg()
    except MissingDependencyError as error:
        pytest.skip(str(error))
    drawn(pliant("render", study, "--out", "bend.mp4", *SMALL, "--fps", "5"))
    head = (study.parent / "bend.mp4").read_bytes()
    assert head[4:8] == b"ftyp"
    assert len(head) > 1000


@pytest.mark.parametrize("ending", ["svg", "png", "pdf"])
def test_a_backbone(pliant, study, ending):
    assert pliant("render", study, "--out", f"line.{ending}", "--backbone").code == 0
    content = (study.parent / f"line.{ending}").read_bytes()
    assert {"svg": b"<svg", "png": b"PNG", "pdf": b"%PDF"}[ending] in content[:600]
    assert len(content) > 5000


WRONG = [
    (["--out", "film.gift"], "did you mean '.gif'?"),
    (["--out", "line.svg"], "needs --backbone"),
    (["--out", "film"], "'' is none of .png, .gif, .mp4"),
    (["--out", "line.gif", "--backbone"], "none of .svg, .png, .pdf"),
    (["--size", "abc"], "--size abc: write width x height"),
    (["--size", "9x9"], "each from 32 to 4096"),
    (["--out", "film.mp4", "--size", "97x64"], "even numbers"),
    (["--out", "film.gif", "--fps", "0"], "--fps 0"),
    (["--out", "film.gif", "--fps", "nan"], "--fps nan"),
    (["--camera", "fron"], "did you mean 'front'?"),
    (["--time", "2"], "the motion goes from 0 to 1 s"),
    (["--out", "film.gif", "--time", "0.5"], "--time is the instant of a .png"),
    (["--seconds", "3"], "--seconds is the length of a film"),
    (["--out", "film.gif", "--seconds", "-1"], "--seconds -1"),
    (["--viewer", "mujocco"], "did you mean 'mujoco'?"),
    (["task=null"], "has no 'task' block"),
]


@pytest.mark.parametrize(("arguments", "says"), WRONG, ids=[" ".join(a) for a, _ in WRONG])
def test_wrong_input(pliant, study, arguments, says):
    before = set(study.parent.iterdir())
    pliant("render", study, *arguments).refused(says)
    assert {p.name for p in set(study.parent.iterdir()) - before} <= {".pliant"}


def test_mp4_without_ffmpeg_is_told(monkeypatch, tmp_path):
    def absent(name):
        raise ImportError(name)

    monkeypatch.setattr(shutil, "which", lambda name: None)
    monkeypatch.setattr(films.importlib, "import_module", absent)
    with pytest.raises(MissingDependencyError, match=r"pip install 'pliant\[video\]'"):
        films.write_film(tmp_path / "film.mp4", 25.0, ())
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("ending", ["png", "gif", "mp4"])
def test_an_interrupted_film_leaves_the_earlier_one(tmp_path, ending):
    path = tmp_path / f"film.{ending}"
    path.write_text("the one before")
    picture = np.zeros((64, 96, 3), np.uint8)

    def interrupted():
        yield from [picture] * 3
        raise KeyboardInterrupt

    try:
        with pytest.raises(KeyboardInterrupt):
            films.write_film(path, 25.0, interrupted())
    except MissingDependencyError as error:
        pytest.skip(str(error))
    assert [p.name for p in tmp_path.iterdir()] == [path.name]
    assert path.read_text() == "the one before"


def test_view_without_a_display_is_told_before_anything_is_computed(pliant, study, monkeypatch):
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    pliant("view", study).refused("no display here")
    assert not (study.parent / ".pliant").exists()


@pytest.mark.slow
def test_results_come_from_the_store_the_second_time(pliant, study):
    drawn(pliant("render", study, "--out", "a.png", *SMALL))
    manifests = list((study.parent / ".pliant" / "store" / "simulate").glob("*/manifest.json"))
    assert len(manifests) == 1
    made = json.loads(manifests[0].read_text())
    pliant("render", study, "--out", "b.png", *SMALL)
    again = list((study.parent / ".pliant" / "store" / "simulate").glob("*/manifest.json"))
    assert [json.loads(p.read_text()) for p in again] == [made]
