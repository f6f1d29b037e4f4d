"""Drawings show the chain's position: skins follow bodies, cameras see everything, missing OpenGL is reported."""

import ctypes.util
import itertools
import sys
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("mujoco")

from pliant.config.chain import ChainConfig
from pliant.errors import MissingDependencyError, UserError
from pliant.interfaces.viewer import Handle
from pliant.mechanics.kinematics import ChainGeometry
from pliant.pipeline.chain import Segment, build_chain, rod_module
from pliant.pipeline.motion import at_times, chain_frames, chain_scene
from pliant.records.motion import Motion
from pliant.records.scene import SceneFrames
from pliant.testing.samples import sample_chain, softening_law
from pliant_view.mujoco.backend import WINDOW, MujocoViewer
from pliant_view.mujoco.camera import VIEWS, camera
from pliant_view.mujoco.config import MujocoViewerConfig
from pliant_view.mujoco.drawing import SceneDrawing
from pliant_view.mujoco.painter import context
from pliant_view.mujoco.skins import chain_skin, dressed

RADIUS_M = 5e-3


def rods(modules=4, **chain):
    """Return a chain of round rods."""
    module = rod_module(softening_law(), 11e-3, 2e-3, RADIUS_M)
    config = ChainConfig.model_validate({"modules": modules, **chain})
    return build_chain(config, [Segment(module, modules)])


def bent(chain, angle):
    return np.full((chain.n_joints, 1), angle)


@pytest.fixture
def viewer():
    return MujocoViewer(MujocoViewerConfig())


def pictures(viewer, motion, size=(120, 90), view="front"):
    try:
        return list(viewer.pictures(motion, size, view))
    except MissingDependencyError as error:
        pytest.skip(str(error))


def test_a_skin_at_rest_is_the_rod():
    chain = rods()
    skin = chain_skin(chain)
    geometry = ChainGeometry.from_chain(chain)
    straight = geometry.forward(bent(chain, 0.0))
    np.testing.assert_allclose(skin.posed(straight, straight), skin.rest.vertices_m, atol=1e-12)
    local = (skin.rest.vertices_m - straight.origins[0]) @ straight.rotations[0]
    assert np.hypot(local[:, 1], local[:, 2]).max() == pytest.approx(RADIUS_M)
    assert np.ptp(local[:, 0]) == pytest.approx(chain.length_m)


def test_a_bent_skin_keeps_its_ends_and_follows_the_joints():
    chain = rods()
    skin, geometry = chain_skin(chain), ChainGeometry.from_chain(chain)
    straight, pose = geometry.forward(bent(chain, 0.0)), geometry.forward(bent(chain, 0.3))
    posed = skin.posed(straight, pose)
    # The end face moves with the last body, rigidly.
    tip = geometry.markers(bent(chain, 0.0))[-1]
    end = np.linalg.norm(skin.rest.vertices_m - tip, axis=1) < 1.01 * RADIUS_M
    assert end.sum() > 10
    turn = pose.rotations[-1] @ straight.rotations[-1].T
    wanted = geometry.markers(bent(chain, 0.3))[-1] + (skin.rest.vertices_m[end] - tip) @ turn.T
    flat = np.abs((skin.rest.vertices_m[end] - tip) @ straight.rotations[-1][:, 0]) < 1e-9
    np.testing.assert_allclose(posed[end][flat], wanted[flat], atol=1e-9)
    # No vertex leaves the neighbourhood of the line through the joints.
    line = geometry.markers(bent(chain, 0.3))
    dense = np.concatenate([np.linspace(a, b, 30) for a, b in itertools.pairwise(line)])
    apart = np.linalg.norm(posed[:, None] - dense[None], axis=2).min(axis=1)
    assert apart.max() < 1.1 * RADIUS_M


def test_an_evenly_bent_rod_is_a_smooth_arc():
    """Its sides are on circles about one centre: no kink from joint to joint."""
    chain = rods(8)
    skin, geometry = chain_skin(chain), ChainGeometry.from_chain(chain)
    straight, pose = geometry.forward(bent(chain, 0.0)), geometry.forward(bent(chain, 0.3))
    local = (skin.rest.vertices_m - straight.origins[0]) @ straight.rotations[0]
    length = chain.length_m / 8
    inside = (local[:, 0] > length) & (local[:, 0] < chain.length_m - length)
    axial = inside & (np.abs(local[:, 1]) < 1e-3 * RADIUS_M)  # the two lines in the plane of bending
    posed = (skin.posed(straight, pose) - pose.origins[0]) @ pose.rotations[0]
    for side in (1, -1):
        x, z = posed[axial & (side * local[:, 2] > 0.9 * RADIUS_M)][:, [0, 2]].T
        rows = np.column_stack([2 * x, 2 * z, np.ones_like(x)])
        centre = np.linalg.lstsq(rows, x**2 + z**2, rcond=None)[0][:2]
        radii = np.hypot(x - centre[0], z - centre[1])
        assert len(radii) > 20 and np.ptp(radii) < 0.01 * RADIUS_M


def test_a_payload_hangs_below_the_tip_and_clears_the_finger():
    chain = rods(8, payload="10 g")
    frames = chain_frames(np.zeros(1), bent(chain, 0.3)[None])
    drawing = SceneDrawing(chain_scene(chain), frames, (64, 48))
    drawing.place(frames, 0)
    body = drawing.model.body("payload0")
    ball = drawing.data.geom_xpos[body.geomadr[0]]
    radius = float(drawing.model.geom_size[body.geomadr[0]][0])
    tip = ChainGeometry.from_chain(chain).markers(bent(chain, 0.3))[-1]
    np.testing.assert_allclose(ball[:2], tip[:2], atol=1e-9)
    assert ball[2] + radius < tip[2] - RADIUS_M
    assert drawing.extent.box[0, 2] <= ball[2] - radius


def test_a_skin_is_closed():
    """Halves are welded and walls between them are removed: every edge belongs to two faces."""
    skin = chain_skin(rods())
    _, place = np.unique(np.round(skin.rest.vertices_m / 1e-7), axis=0, return_inverse=True)
    faces = place.ravel()[skin.rest.faces]
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    _, count = np.unique(edges, axis=0, return_counts=True)
    assert set(count.tolist()) == {2}


def test_a_rigid_shape_keeps_its_form_when_the_chain_bends():
    chain = rods()
    chain = chain.with_(
        shapes=tuple(tuple(replace(shape, rigid=True) for shape in body) for body in chain.shapes)
    )
    skin = chain_skin(chain)
    geometry = ChainGeometry.from_chain(chain)
    straight, pose = geometry.forward(bent(chain, 0.0)), geometry.forward(bent(chain, 0.4))
    after = skin.posed(straight, pose)
    for body in range(chain.n_joints + 1):
        mine = skin.body == body
        assert mine.any()
        local = (after[mine] - pose.origins[body]) @ pose.rotations[body]
        rest = (skin.rest.vertices_m[mine] - straight.origins[body]) @ straight.rotations[body]
        np.testing.assert_allclose(local, rest, atol=1e-12)


def test_a_chain_without_shapes_is_drawn_as_rods():
    chain = sample_chain(modules=3)
    assert chain_skin(chain) is None
    assert len(chain_skin(dressed(chain)).body) > 100


@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("size", [(640, 360), (200, 400)])
def test_cameras_see_all_points(view, size):
    points = np.random.default_rng(1).normal(size=(60, 3)) * [0.05, 0.02, 0.1] + [0.3, 0.1, -0.2]
    made = camera(view, points, 30.0, size)
    a, e = np.radians(made.azimuth), np.radians(made.elevation)
    forward = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    right = np.array([np.sin(a), -np.cos(a), 0.0])
    up = np.cross(right, forward)
    away = points - (np.array(made.lookat) - made.distance * forward)
    tall = np.tan(np.radians(15.0))
    x = away @ right / (away @ forward) / (tall * size[0] / size[1])
    y = away @ up / (away @ forward) / tall
    seen = max(np.abs(x).max(), np.abs(y).max())
    assert 0.75 < seen <= 1.0


def test_frames_between_the_recorded_ones():
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    frames = SceneFrames(
        np.array([0.0, 2.0]),
        np.array([[0.0, 0, 0], [0, 0, 4.0]]),
        (np.array([[[0.0]], [[1.0]]]),),
        np.array([[[0.0, 0, 0]], [[2.0, 0, 0]]]),
        np.array([[np.eye(3)], [quarter]]),
    )
    middle = at_times(frames, np.array([1.0, 2.0, 5.0]))
    assert middle.carriage_m[:, 2].tolist() == [2.0, 4.0, 4.0]
    assert middle.coordinates[0][:, 0, 0].tolist() == [0.5, 1.0, 1.0]
    half = np.sqrt(0.5)
    np.testing.assert_allclose(
        middle.rotations[0, 0], [[half, -half, 0], [half, half, 0], [0, 0, 1]], atol=1e-12
    )
    np.testing.assert_allclose(middle.rotations[1, 0], quarter, atol=1e-12)


@pytest.mark.slow
def test_a_picture_shows_the_tip_on_the_side_to_which_it_bends(viewer):
    chain = rods(8)
    q = np.array([bent(chain, 0.0), bent(chain, 0.35)])
    straight, right = pictures(viewer, Motion(chain_scene(chain), chain_frames(np.arange(2.0), q)))
    (left,) = pictures(
        viewer,
        Motion(
            chain_scene(chain),
            chain_frames(np.zeros(1), -q[1:]),
            chain_frames(np.arange(3.0), np.array([*q, -q[1]])),
        ),
    )
    warm = [(p[..., 0].astype(int) - p[..., 2] > 40) for p in (straight, right, left)]  # the colour of rubber
    columns = [np.flatnonzero(w.any(axis=0)) for w in warm]
    assert all(len(c) > 3 for c in columns)
    assert columns[1].max() > columns[0].max() + 10
    # With both sides in view, the base is in the middle and bending the other way goes to its left.
    assert columns[2].mean() < 55


@pytest.mark.slow
def test_pictures_are_lit_and_not_in_one_colour(viewer):
    chain = rods(8, payload="10 g")
    motion = Motion(chain_scene(chain), chain_frames(np.zeros(1), bent(chain, 0.3)[None]))
    for view in VIEWS:
        (picture,) = pictures(viewer, motion, view=view)
        assert 60 < picture.mean() < 245
        assert picture.std() > 10


@pytest.mark.slow
def test_two_viewers_at_once_do_not_disturb_each_other(viewer):
    chain = rods(3)
    motion = Motion(
        chain_scene(chain), chain_frames(np.arange(2.0), np.array([bent(chain, 0.0), bent(chain, 0.5)]))
    )
    alone = pictures(viewer, motion)
    first, second = viewer.pictures(motion, (120, 90), "front"), viewer.pictures(motion, (60, 60), "top")
    mixed = [next(first), next(second), next(first), next(second)]
    np.testing.assert_array_equal(mixed[0], alone[0])
    np.testing.assert_array_equal(mixed[2], alone[1])


def test_no_opengl_is_told_with_what_to_install(monkeypatch):
    if not sys.platform.startswith("linux"):
        pytest.skip("other systems bring OpenGL with them")
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    monkeypatch.setattr(ctypes.util, "find_library", lambda name: None)
    with pytest.raises(MissingDependencyError, match="libegl1 .* libosmesa6"):
        context(10, 10)


def test_no_display_is_told(monkeypatch, viewer):
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(UserError, match="no display here .*pliant render"):
        viewer.require_display()


class Sliders(Handle):
    """Two inputs of which nothing depends."""

    inputs = {"pressure_pa": (0.0, 15e3), "tendon_force_n": (0.0, 8.0)}  # noqa: RUF012

    def advance(self, values, duration_s):
        raise AssertionError


def test_sliders_become_controls_with_their_ranges():
    chain = rods(2)
    frames = chain_frames(np.zeros(1), bent(chain, 0.1)[None])
    drawing = SceneDrawing(chain_scene(chain), frames, WINDOW, Sliders().inputs)
    names = [drawing.model.actuator(k).name for k in range(drawing.model.nu)]
    assert names == ["pressure_pa", "tendon_force_n"]
    np.testing.assert_array_equal(drawing.model.actuator_ctrlrange, [[0, 15e3], [0, 8]])
