"""Checks of a `Viewer`: pictures of a small chain that bends."""

from __future__ import annotations

import numpy as np

from pliant.interfaces.viewer import Picture, Viewer
from pliant.records.motion import Motion
from pliant.records.scene import Arm, Scene, SceneFrames
from pliant.testing import Subject, once, require
from pliant.testing.samples import sample_chain

SIZE = (96, 64)
BENDS_RAD = (0.0, 0.5, 0.0)
LEAST_SEEN = 0.002  # share of the pixels


def _motion() -> Motion:
    chain = sample_chain(modules=3)
    times = np.linspace(0.0, 1.0, len(BENDS_RAD))
    q = np.array(BENDS_RAD)[:, None, None] * np.ones((1, chain.n_joints, 1))
    none = np.zeros((len(times), 0, 3)), np.zeros((len(times), 0, 3, 3))
    return Motion(Scene((Arm(chain),)), SceneFrames(times, np.zeros((len(times), 3)), (q,), *none))


@once
def _pictures(subject: Subject) -> list[Picture]:
    viewer: Viewer = subject.build()
    return list(viewer.pictures(_motion(), SIZE, "front"))


def gives_a_picture_per_frame(subject: Subject) -> None:
    """`pictures` gives one (height, width, 3) array of uint8 per frame."""
    pictures = _pictures(subject)
    require(len(pictures) == len(BENDS_RAD), f"{len(BENDS_RAD)} frames gave {len(pictures)} pictures")
    for picture in pictures:
        got = (picture.shape, picture.dtype.name)
        require(got == ((SIZE[1], SIZE[0], 3), "uint8"), f"a picture of {SIZE[0]}x{SIZE[1]} is {got}")


def shows_the_motion(subject: Subject) -> None:
    """the chain and its motion are visible."""
    straight, bent, *_ = _pictures(subject)
    require(np.ptp(straight.reshape(-1, 3), axis=0).any(), "a picture is of one colour: nothing is seen")
    moved = float(np.any(straight != bent, axis=2).mean())
    require(moved > LEAST_SEEN, f"a straight and a bent chain differ in {moved:.2%} of the pixels")


def draws_a_pose_always_alike(subject: Subject) -> None:
    """the same pose gives the same picture: the camera does not move."""
    first, _, again = _pictures(subject)
    # Shading may round differently; a moved camera changes edges everywhere.
    apart = float(np.mean(np.abs(first.astype(int) - again.astype(int)) > 8))
    require(apart < LEAST_SEEN, f"two pictures of one pose differ in {apart:.2%} of the values")
