"""Numbers and frames in URDF."""

from __future__ import annotations

from collections.abc import Iterable
from math import atan2, cos, hypot, sin
from xml.etree import ElementTree

import numpy as np

from pliant.records.design import Array


def add_origin(element: ElementTree.Element, position: Array, rotation: Array) -> None:
    """An `origin` with a position and fixed-axis angles."""
    ElementTree.SubElement(element, "origin", xyz=text(position), rpy=text(roll_pitch_yaw(rotation)))


def roll_pitch_yaw(rotation: Array) -> tuple[float, float, float]:
    """Angles with R = Rz(yaw) Ry(pitch) Rx(roll), accurate also at a pitch of ±90°."""
    R = np.asarray(rotation, float)
    yaw = atan2(R[1, 0], R[0, 0])
    pitch = atan2(-R[2, 0], hypot(R[0, 0], R[1, 0]))
    # Roll from the axes with yaw undone: no division by cos(pitch).
    sine = sin(yaw) * R[0, 2] - cos(yaw) * R[1, 2]
    cosine = cos(yaw) * R[1, 1] - sin(yaw) * R[0, 1]
    return atan2(sine, cosine), pitch, yaw


def text(values: Iterable[float]) -> str:
    """Numbers as an attribute, without loss."""
    return " ".join(repr(float(value)) for value in values)
