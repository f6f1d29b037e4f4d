"""Stills of MuJoCo models, with the places of effects at the pixels where they are drawn."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.command import called
from tests.pliant_mjcf.mjcf_models import model_of, pendulum
from tests.pliant_mjcf.test_export import LIMB

import pliant
from pliant.interfaces.model import SystemPicture
from pliant_mjcf.picture import SIZE

BODY = """<mujoco><worldbody>{geoms}<body name="arm" pos="0 0 1"><joint name="hinge" axis="0 1 0"/>
<geom name="ball" type="sphere" size=".1" rgba="1 0 0 1"/>
<geom type="box" size=".05 .05 .3" pos="1 0 0" rgba="0 0 1 1"/>
<site name="tip" pos="1 0 0"/></body></worldbody><actuator><motor name="push" joint="hinge"/></actuator>
<sensor><framepos name="tip" objtype="site" objname="tip"/></sensor></mujoco>"""


def drawn(tmp_path: Path, xml: str, *places: tuple[str, str]) -> SystemPicture:
    found = model_of(tmp_path, xml).picture(places)
    assert found is not None and found.pixels.shape == (SIZE[1], SIZE[0], 3)
    return found


def colour_at(picture: SystemPicture, place: Any) -> Any:
    column, row = place
    return picture.pixels[round(row), round(column)]


def test_places_are_where_their_geoms_are_drawn(tmp_path: Path) -> None:
    places = (("joint", "hinge"), ("input", "push_n_m"), ("output", "tip_x_m"), ("world", "world"))
    picture = drawn(tmp_path, BODY.format(geoms=""), *places)
    joint, actuator, tip, world = picture.places
    assert joint == actuator and world is None
    red, _, other = colour_at(picture, joint)
    assert red > 120 and other == 0
    nothing, _, blue = colour_at(picture, tip)
    assert blue > 120 and nothing == 0
    assert np.all(picture.pixels[0] == 255)


def test_the_nearest_surface_hides_the_others(tmp_path: Path) -> None:
    # from the camera's corner the wall stands before the ball, or behind it
    for side, hidden in ((1.0, True), (-1.0, False)):
        wall = f'<geom type="box" size=".4 .4 .4" pos="{0.6 * side} {-0.9 * side} {1 + 0.4 * side}" rgba="0 1 0 1"/>'
        picture = drawn(tmp_path, BODY.format(geoms=wall), ("joint", "hinge"))
        _, green, _ = colour_at(picture, picture.places[0])
        assert bool(green > 100) is hidden


@pytest.mark.parametrize("shape", ["sphere", "capsule", "cylinder", "ellipsoid", "box"])
def test_shapes_cover_their_silhouette_without_holes(tmp_path: Path, shape: str) -> None:
    geom = f'<geom type="{shape}" size=".2 .1 .15" pos="0 0 .5"/>'
    xml = BODY.format(geoms="").replace('<geom name="ball" type="sphere" size=".1" rgba="1 0 0 1"/>', geom)
    shown = np.any(drawn(tmp_path, xml).pixels < 250, axis=2)
    for row in shown[:, : SIZE[0] // 2] if shape != "box" else shown[:, :0]:
        filled = np.flatnonzero(row)
        assert not len(filled) or row[filled[0] : filled[-1] + 1].all()
    assert shown.sum() > 2000


def test_a_model_without_geoms_has_no_picture(tmp_path: Path) -> None:
    assert model_of(tmp_path, pendulum()).picture([]) is None


def test_tendons_are_marked_at_their_joint(tmp_path: Path) -> None:
    picture = drawn(tmp_path, LIMB, ("tendon", "cord"), ("joint", "knuckle"), ("body", "upper"))
    assert picture.places[0] == picture.places[1] != picture.places[2]


def test_pages_show_where_effects_act(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "limb.xml").write_text(LIMB)
    rows = "\n".join(f"{0.02 * k:.2f},{0.1 * np.sin(0.2 * k):.4f},0,0,0.0{k % 7},0.1,0" for k in range(80))
    heads = "time_s,servo_rad,motor_n_m,puller,shoulder_angle_rad,elbow_angle_rad,knuckle_angle_rad"
    (tmp_path / "bench.csv").write_text(f"{heads}\n{rows}\n")
    (tmp_path / "limb.yaml").write_text(
        "name: limb\nmodel: {kind: mjcf, file: limb.xml}\nmeasurements: {file: bench.csv}\n"
        "effects: [{kind: coulomb_friction@elbow, moment: 0.05 N*m}, {kind: gravity_scale, factor: 0.9}]\n"
    )
    called("compare", "limb.yaml", "--out", "page").done()
    page = (tmp_path / "page" / "report.html").read_text()
    assert (tmp_path / "page" / "pictures" / "system.png").is_file()
    words = re.sub(
        r"\s+", " ", re.sub(r"<script.*?</script>|<style.*?</style>|<[^>]+>", " ", page, flags=re.DOTALL)
    )
    assert "Where it acts" in words and "joints: elbow" in words and "gravity_scale the world" in words
    shown = pliant.open(tmp_path / "limb.yaml", store=tmp_path / "store").compare()._repr_html_()
    assert '<img alt="the model" src="data:image/png;base64,' in shown
    assert not re.search(r"\b(chain|bend|pressure|valve|finger)s?\b", words, flags=re.IGNORECASE)
