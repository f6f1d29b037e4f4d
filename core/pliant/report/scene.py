"""A body in space over the states of a result: what the 3D view of a page draws.

The page's own code (`templates/scene.js`) draws it: a depth buffer of some 200 lines on a plain canvas. A library was
weighed against it: three.js (MIT) is about 700 kB in a page that is to stay under 3 MB with its pictures, and WebGL
gives a page 16 contexts at most, and none where a browser runs without a graphics card. A finger of eight modules is
50 000 triangles, which a processor draws in some 20 ms.

Skins are kept in section coordinates, one piece for all modules and mirror images, and bent on the page: a chain of
forty modules over sixty states is hardly larger than one module.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pliant.records.design import Array
from pliant.records.fem import IntArray
from pliant.report.chart import PackedLists, script_json
from pliant.user_text import visible


@dataclass(frozen=True, eq=False)
class SceneSkin:
    """A piece at several levels, straight; it is bent about y where it stands.

    Attributes:
        section_m: (levels, n, 3) coordinates (s, y, z): s along the line z = 0, which keeps its length.
        length_m: (levels,) of that line, from the start section to the end section.
        faces: (g, 9) faces by the name of their part: local node a + 3 b, normals ∂x/∂a × ∂x/∂b out of the solid.
        values: (levels, n) what can colour it, by the name of the colouring.
    """

    section_m: Array
    length_m: Array
    faces: Mapping[str, IntArray]
    values: Mapping[str, Array] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Copy:
    """Which faces of a skin are drawn, mirrored where a sign of (s, y, z) is −1, in which of the views ("": in all)."""

    faces: str
    signs: tuple[int, int, int] = (1, 1, 1)
    view: str = ""


@dataclass(frozen=True, eq=False)
class SceneBody:
    """What moves as one: copies of a skin, and in each of f states its level, its bend and its place.

    Attributes:
        skin: its number among the scene's.
        copies: what of it is drawn.
        level: (f,) place among the skin's levels, between two of them too.
        angle_rad: (f,) the turn of the end section against the start section, about y.
        rotation, centre_m: (f, 3, 3) and (f, 3) pose of the start section in the world.
        values: (f,) one value for the whole body, by the name of the colouring.
    """

    skin: int
    copies: tuple[Copy, ...]
    level: Array
    angle_rad: Array
    rotation: Array
    centre_m: Array
    values: Mapping[str, Array] = field(default_factory=dict)


@dataclass(frozen=True)
class Colouring:
    """What colours stand for: its words with the unit, its ends, and colours (#rrggbb) between them."""

    name: str
    label: str
    limits: tuple[float, float]
    colours: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class DrawnScene:
    """Bodies over a slider, or over two: all states under the first load, then under the second, and so on.

    Attributes:
        slider: what it moves through, e.g. "pressure".
        states: the words of each state, e.g. "15 kPa".
        skins, bodies: what is drawn.
        colourings: to choose from.
        views: names of the views to choose from; empty where there is one.
        camera: (3, 3) rows: unit vectors to the right, upwards and toward the viewer.
        middle_m, radius_m: a ball that holds all states.
        beside: whether the still picture stays beside it, as it shows more than the scene.
        loads: the words of each load, e.g. "13 g"; empty where there is one.
        load: the number of the one that is shown first.
    """

    slider: str
    states: tuple[str, ...]
    skins: tuple[SceneSkin, ...]
    bodies: tuple[SceneBody, ...]
    colourings: tuple[Colouring, ...]
    camera: Array
    middle_m: Array
    radius_m: float
    views: tuple[str, ...] = ()
    beside: bool = False
    loads: tuple[str, ...] = ()
    load: int = 0

    @property
    def script_data(self) -> str:
        """As JSON for a script element, in which no name can close the element."""
        pool = PackedLists()
        skins = [
            {
                "levels": len(skin.section_m),
                "points": pool.place(skin.section_m),
                "length": pool.place(skin.length_m),
                "faces": {name: np.asarray(faces).ravel().tolist() for name, faces in skin.faces.items()},
                "values": {name: pool.place(values) for name, values in skin.values.items()},
            }
            for skin in self.skins
        ]
        bodies = [
            {
                "skin": body.skin,
                "copies": [vars(copy) for copy in body.copies],
                "level": pool.place(body.level),
                "angle": pool.place(body.angle_rad),
                "rotation": pool.place(body.rotation),
                "centre": pool.place(body.centre_m),
                "values": {name: pool.place(values) for name, values in body.values.items()},
            }
            for body in self.bodies
        ]
        shown: dict[str, Any] = {
            "slider": visible(self.slider),
            "states": [visible(one) for one in self.states],
            "skins": skins,
            "bodies": bodies,
            "colourings": [{**vars(one), "label": visible(one.label)} for one in self.colourings],
            "views": list(self.views),
            "camera": np.asarray(self.camera, float).ravel().tolist(),
            "middle": np.asarray(self.middle_m, float).tolist(),
            "radius": float(self.radius_m),
            "beside": self.beside,
            "loads": [visible(one) for one in self.loads],
            "load": self.load,
        }
        return script_json(shown | {"lists": pool.as_json()})


def ball(points: Array, margin_m: float = 0.0) -> tuple[Array, float]:
    """Middle (3,) and radius of a ball about points (…, 3): about the middle of their box, and `margin_m` larger."""
    flat = np.asarray(points, float).reshape(-1, 3)
    middle = (flat.min(axis=0) + flat.max(axis=0)) / 2
    return middle, float(np.linalg.norm(flat - middle, axis=1).max()) + margin_m
