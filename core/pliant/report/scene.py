"""The 3D view of a page: bodies over the states of a result.

The page's own code (`templates/scene.js`) draws it: a depth buffer of some 200 lines on a plain canvas. The alternative
was three.js (MIT): it is about 700 kB in a page that is to stay under 3 MB with its pictures, and WebGL gives a page at
most 16 contexts, and none in a browser without a graphics card. A finger of eight modules is
50 000 triangles, which a processor draws in some 20 ms.

Skins are stored in section coordinates, one piece for all modules and mirror images, and bent on the page: a chain of
forty modules over sixty states is hardly larger than one module.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pliant.records.design import Array
from pliant.records.fem import IntArray
from pliant.report.chart_json import PackedLists, script_json
from pliant.user_text import escape_controls


@dataclass(frozen=True, eq=False)
class SceneSkin:
    """A straight piece at several levels; it is bent about y at its place.

    Attributes:
        section_m: (levels, n, 3) coordinates (s, y, z): s along the line z = 0, which keeps its length.
        length_m: (levels,) of that line, from the start section to the end section.
        faces: (g, 9) faces by the name of their part: local node a + 3 b, normals ∂x/∂a × ∂x/∂b out of the solid.
        values: (levels, n) by the name of the colouring.
    """

    section_m: Array
    length_m: Array
    faces: Mapping[str, IntArray]
    values: Mapping[str, Array] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Copy:
    """The drawn faces of a skin, mirrored where a sign of (s, y, z) is −1, and the view that shows them ("": all)."""

    faces: str
    signs: tuple[int, int, int] = (1, 1, 1)
    view: str = ""


@dataclass(frozen=True, eq=False)
class SceneBody:
    """A moving body: copies of a skin, and in each of f states its level, its bend and its pose.

    Attributes:
        skin: its index in the scene.
        copies: its drawn faces.
        level: (f,) position among the skin's levels, possibly between two of them.
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
    """The meaning of colours: its words with the unit, its ends, and colours (#rrggbb) between them."""

    name: str
    label: str
    limits: tuple[float, float]
    colours: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class DrawnScene:
    """Bodies over one or two sliders: all states under the first load, then under the second, and so on.

    Attributes:
        slider: the quantity that it changes, e.g. "pressure".
        states: the words of each state, e.g. "15 kPa".
        skins, bodies: the drawn ones.
        colourings: to choose from.
        views: names of the views to choose from; empty for one view.
        camera: (3, 3) rows: unit vectors to the right, upwards and toward the viewer.
        middle_m, radius_m: a ball around all states.
        beside: whether the static picture is shown too, because it shows more than the scene.
        loads: the words of each load, e.g. "13 g"; empty for one load.
        load: the index of the one that is shown first.
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
        """Return JSON for a script element, in which no name can close the element."""
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
            "slider": escape_controls(self.slider),
            "states": [escape_controls(one) for one in self.states],
            "skins": skins,
            "bodies": bodies,
            "colourings": [{**vars(one), "label": escape_controls(one.label)} for one in self.colourings],
            "views": list(self.views),
            "camera": np.asarray(self.camera, float).ravel().tolist(),
            "middle": np.asarray(self.middle_m, float).tolist(),
            "radius": float(self.radius_m),
            "beside": self.beside,
            "loads": [escape_controls(one) for one in self.loads],
            "load": self.load,
        }
        return script_json(shown | {"lists": pool.as_json()})


def ball(points: Array, margin_m: float = 0.0) -> tuple[Array, float]:
    """Return middle (3,) and radius of a ball about points (…, 3): centred in their box, and `margin_m` larger."""
    flat = np.asarray(points, float).reshape(-1, 3)
    middle = (flat.min(axis=0) + flat.max(axis=0)) / 2
    return middle, float(np.linalg.norm(flat - middle, axis=1).max()) + margin_m
