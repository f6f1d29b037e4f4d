"""The 3D view: the page positions objects as the still pictures do; it can be turned, played and read aloud."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.app.test_in_the_browser import CHROMIUM, QUIET, playwright
from tests.report.pages import check_sound

from pliant.pipeline.run_folder import FinishedRun
from pliant.records.load_frames import LoadFrames
from pliant.records.rollout import Rollout
from pliant.report.figures.finger import finger_bodies
from pliant.report.render import page as page_of
from pliant.report.run import run_document
from pliant.report.scenes.module import module_scene
from pliant.report.scenes.robot import MOST_STATES, robot_scene

HOSTILE = "</script><script>hit=1</script>"
SCENE = "figure[data-scene]"


def with_history(run: FinishedRun, markers: Any, angles: Any) -> FinishedRun:
    """Return the run with another history of its first engine."""
    steps = np.linspace(0, 1, len(markers))
    history = Rollout(steps, 15e3 * steps[:, None], angles, markers)
    first = run.engines[0]
    result = replace(first.result, rollout=history)
    return replace(run, engines=(replace(first, result=result),))


def test_without_shapes_rods_reach_from_base_to_tip_in_every_state(kit: Any) -> None:
    run = kit.full_run(3)
    run = replace(run, designs=(replace(run.designs[0], fem=None, module=None),))
    scene, history = robot_scene(run), run.engines[0].result.rollout
    assert scene is not None and len(scene.bodies) == 6 and len(scene.states) == len(history.time_s)
    for one, following in zip(scene.bodies[:-1], scene.bodies[1:], strict=True):
        skin = scene.skins[0]
        reach = one.level * (skin.section_m[1, :, 0].max() - skin.section_m[0, :, 0].max())
        assert one.centre_m + reach[:, None] * one.rotation[:, :, 0] == pytest.approx(
            following.centre_m, abs=1e-12
        )
    assert scene.bodies[0].centre_m == pytest.approx(history.markers_m[:, 0])
    far = np.linalg.norm(history.markers_m - scene.middle_m, axis=2)
    assert far.max() < scene.radius_m


def test_a_long_history_is_thinned_and_keeps_its_ends(kit: Any) -> None:
    run, count = kit.full_run(2), 500
    angles = np.linspace(0, 0.3, count)[:, None, None] * np.ones((1, 2, 1))
    markers = np.stack([kit.markers(q) for q in angles])
    scene = robot_scene(with_history(run, markers, angles))
    assert scene is not None and len(scene.states) == MOST_STATES
    assert (scene.states[0], scene.states[-1]) == ("0 kPa", "15 kPa")
    assert len(scene.script_data) < 200_000


def loaded(run: FinishedRun) -> FinishedRun:
    """Return the run with frames under half of 13 g, where it bends half as much."""
    own = run.engines[0].result.rollout
    assert own is not None
    turns, markers = ([0.5 * values, values] for values in (own.joint_angles, own.markers_m))
    return replace(
        run, loads=LoadFrames(0.013, 0.0, np.array([0.5, 1.0]), np.stack(turns), np.stack(markers))
    )


def test_a_load_slider_has_every_state_under_every_load(kit: Any) -> None:
    run = kit.full_run(2)
    plain, scene = robot_scene(run), robot_scene(loaded(run))
    assert plain is not None and scene is not None and plain.loads == ()
    assert (scene.loads, scene.load, scene.states) == (("6.5 g", "13 g"), 1, plain.states)
    n = len(plain.states)
    for one, other in zip(plain.bodies, scene.bodies, strict=True):
        assert other.angle_rad[n:] == pytest.approx(one.angle_rad)
        assert other.angle_rad[:n] == pytest.approx(0.5 * one.angle_rad)
        assert np.isnan(other.values["apart"][:n]).all()  # other engines were not evaluated there
        assert other.values["apart"][n:] == pytest.approx(one.values["apart"])


def test_a_module_shows_its_free_states_and_its_law_error(kit: Any) -> None:
    scene = module_scene(kit.dataset(), kit.PlainLaw())
    assert scene is not None and len(scene.states) == 3 and scene.views == ("whole", "cut open")
    p, u = np.array([0.0, 7.5e3, 15e3]), np.array([0.0, 0.18, 0.36])[:, None]
    expected = 1e3 * np.abs(kit.PlainLaw().evaluate(p, u).tau[:, 0])
    assert scene.bodies[0].values["error"] == pytest.approx(expected)
    assert module_scene(kit.dataset(shapes=False)) is None


def test_names_cannot_leave_their_element(kit: Any) -> None:
    scene = robot_scene(kit.full_run(2))
    assert scene is not None
    text = replace(scene, slider=HOSTILE, states=(HOSTILE,) * len(scene.states)).script_data
    assert not set("<>&") & set(text) and json.loads(text)["slider"] == HOSTILE


@pytest.fixture(scope="module")
def opened(kit: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """Return a run's page in headless Chromium; script errors fail the test at the end."""
    if CHROMIUM is None:
        pytest.skip("chromium is not installed: apt-get install chromium")
    made = page_of(run_document(loaded(kit.full_run(3))))
    check_sound(made)
    file: Path = tmp_path_factory.mktemp("scene") / "report.html"
    file.write_text(made.html, "utf-8")
    wrong: list[str] = []
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=QUIET)

        def make(**settings: Any) -> Any:
            page = browser.new_context(viewport={"width": 1000, "height": 900}, **settings).new_page()
            page.on("pageerror", lambda error: wrong.append(str(error)))
            page.goto(file.as_uri())
            return page

        yield make
        browser.close()
    assert not wrong


@pytest.mark.slow
def test_the_page_places_and_shows_what_the_still_picture_draws(kit: Any, opened: Any) -> None:
    page = opened()
    page.wait_for_selector(f"{SCENE} .space[data-drawn]")
    placed = np.array(page.evaluate("Array.from(document.querySelector('figure[data-scene]').scene.points)"))
    bodies = finger_bodies(kit.full_run(3))
    assert bodies is not None
    found, expected = placed.reshape(-1, 3), bodies.settled.points
    assert found.min(axis=0) == pytest.approx(expected.min(axis=0), abs=2e-6)
    assert found.max(axis=0) == pytest.approx(expected.max(axis=0), abs=2e-6)
    canvas = page.locator(f"{SCENE} canvas").first
    share = canvas.evaluate(
        "c => { const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data; let n = 0;"
        "for (let k = 0; k < d.length; k += 4) n += d[k] + d[k + 1] + d[k + 2] < 740; return n / (d.length / 4); }"
    )
    assert 0.02 < share < 0.9


@pytest.mark.slow
def test_keys_turn_it_the_slider_moves_it_and_both_have_names(opened: Any) -> None:
    page = opened()
    space = page.locator(f"{SCENE} .space").first
    page.wait_for_selector(f"{SCENE} .space[data-drawn]")
    first = space.get_attribute("data-drawn")

    def drawn(pattern: str) -> str:
        for _ in range(50):
            page.wait_for_timeout(40)
            if pattern in (now := space.get_attribute("data-drawn")):
                return str(now)
        raise AssertionError(f"{pattern} not in {now}")

    page.locator(f"{SCENE} canvas").first.press("ArrowRight")
    page.wait_for_timeout(300)
    assert space.get_attribute("data-drawn") != first
    page.locator(f"{SCENE} canvas").first.press("0")
    page.wait_for_timeout(300)
    assert space.get_attribute("data-drawn") == first
    slider = page.get_by_role("slider", name="pressure").first
    slider.press("Home")
    assert drawn("0  ").startswith("0 ") and slider.get_attribute("aria-valuetext") == "0 kPa"
    page.get_by_role("button", name="play").first.click()
    drawn("2  ")
    page.get_by_role("button", name="pause").first.click()
    load = page.get_by_role("slider", name="load").first
    before = page.evaluate(f"Array.from(document.querySelector('{SCENE}').scene.points)")
    load.press("Home")
    drawn("load 0")
    assert load.get_attribute("aria-valuetext") == "6.5 g"
    assert page.evaluate(f"Array.from(document.querySelector('{SCENE}').scene.points)") != before
    assert page.get_by_role("img", name="In space").first.is_visible()


@pytest.mark.slow
def test_without_scripts_and_on_paper_the_still_picture_stands_alone(opened: Any) -> None:
    without = opened(java_script_enabled=False)
    assert without.locator(f"{SCENE} img").first.is_visible() and without.locator("canvas").count() == 0
    printed = opened()
    printed.wait_for_selector(f"{SCENE} .space[data-drawn]")
    printed.emulate_media(media="print")
    assert printed.locator(f"{SCENE} img").first.is_visible()
    assert not printed.locator(f"{SCENE} canvas").first.is_visible()
