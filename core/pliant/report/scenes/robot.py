"""A robot over the history of its task: modules with their FEM shapes if there are any, else the links as rods."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.colors import Colormap

from pliant.formatting import Unit, actuation_unit, deformation_unit, display_unit, output_unit
from pliant.pipeline.run_folder import FinishedRun
from pliant.records.design import Array
from pliant.records.fem import IntArray
from pliant.records.load_frames import LoadFrames
from pliant.records.rollout import Rollout
from pliant.report.chart import ChartAxis
from pliant.report.figures import body, style
from pliant.report.figures.finger import ShapedModules, finger_camera, shaped_modules
from pliant.report.figures.rendering import TRANSPOSED
from pliant.report.run_view import base_pose, main_axis, module_designs
from pliant.report.scene import Colouring, Copy, DrawnScene, SceneBody, SceneSkin, ball
from pliant.report.scenes.module import STRETCH, mirror_signs, ramp, section_skin, stretch_colouring

MOST_STATES = 60
SIDES = 8  # faces around a rod
SLENDER = 0.16  # radius of a rod over the length of a module
BEND, BAND, APART = "bend", "band", "apart"


@dataclass(frozen=True, eq=False)
class StateError:
    """The model's error in each sample of the first engine's history: its words with a unit, and (t,) values in it."""

    label: str
    values: Array


def robot_scene(
    run: FinishedRun, errors: Sequence[StateError] = (), other: str = "the farthest other engine"
) -> DrawnScene | None:
    """Return the chain of the first engine over its history, and over its load if the run has other loads too.

    None without a history, or for a chain in contact.

    Args:
        run: the simulated one.
        errors: further colourings.
        other: name of the other engines.
    """
    if not run.engines or run.engines[0].result.stills:
        return None
    history = run.engines[0].result.rollout
    if history is None or len(history.time_s) < 2 or not np.isfinite(history.markers_m).all():
        return None
    at = np.unique(np.linspace(0, len(history.time_s) - 1, MOST_STATES).round().astype(int))
    loads = run.loads or LoadFrames.only(history)
    shown = Rollout(
        np.tile(history.time_s[at], len(loads.shares)),
        np.tile(history.actuation[at], (len(loads.shares), 1)),
        np.concatenate(loads.joint_angles[:, at]),
        np.concatenate(loads.markers_m[:, at]),
    )
    by_module = _by_module(run, shown, loads.own, at, errors, other)
    values = {name: column for name, (_, column) in by_module.items()}
    colourings = [colouring for colouring, _ in by_module.values()]
    modules = shaped_modules(run)
    if modules is not None and shown.actuation.shape[1] == 1:
        skins, bodies, thick = _shaped(modules, shown, values)
        every = [section for sections in modules.sections for section in sections]
        colourings = [stretch_colouring(every), *colourings]
    else:
        skins, bodies, thick = _rods(shown, values, base_pose(run)[1])
    camera = finger_camera(run)
    middle_m, radius_m = ball(shown.markers_m, thick)
    return DrawnScene(
        *_words(run, shown, len(at)),
        tuple(skins),
        tuple(bodies),
        tuple(colourings),
        np.stack([camera.right, camera.up, camera.toward]),
        middle_m,
        radius_m,
        beside=True,
        loads=loads.words,
        load=loads.own,
    )


def _words(run: FinishedRun, shown: Rollout, count: int) -> tuple[str, tuple[str, ...]]:
    """Return the quantity of the slider, and the words of each of its `count` states."""
    name = run.designs[0].law.actuation_name
    unit, moving = actuation_unit(name), not run.engines[0].result.final.at_rest
    driven = [", ".join(unit.text(float(v), 3) for v in row) for row in shown.actuation[:count]]
    if not moving:
        return output_unit(name).label if shown.actuation.shape[1] == 1 else "actuation", tuple(driven)
    return "time", tuple(
        f"{t:.3g} s, {p}" for t, p in zip(shown.time_s[:count].tolist(), driven, strict=True)
    )


def _by_module(
    run: FinishedRun,
    shown: Rollout,
    own: int,
    at: IntArray,
    errors: Sequence[StateError],
    other: str,
) -> dict[str, tuple[Colouring, Array]]:
    """Return ends and values (states, modules) of each colouring: bend, the law's band, errors, other engines.

    Errors and other engines are known only under the run's own load.
    """
    first = run.engines[0].result.rollout
    assert first is not None
    law = run.designs[0].law
    bend = shown.joint_angles[:, :, main_axis(law)]
    mine = slice(own * len(at), (own + 1) * len(at))

    def known(values: Array) -> Array:
        found = np.full_like(bend, np.nan)
        found[mine] = values
        return found

    unit, found = deformation_unit(law), {}
    word = "extension" if law.joint == "prismatic" else "bend"
    found[BEND] = _coloured(BEND, f"{word} of the module", unit, bend, style.stress_map())
    if (band := _band(run, shown)) is not None:
        label = f"90 % band of the law, as {'an extension' if law.joint == 'prismatic' else 'an angle'}"
        found[BAND] = _coloured(BAND, label, unit, band, style.stretch_map())
    for number, error in enumerate(errors):
        column, name = known(error.values[at][:, None]), f"error {number}"
        low, high = 0.0, float(np.nanmax(column, initial=0.0)) or 1.0
        found[name] = Colouring(name, error.label, (low, high), ramp(style.stretch_map())), column
    others = [engine for engine in run.engines[1:] if engine.result.rollout is not None]
    apart = [
        np.linalg.norm(history.markers_m[at, 1:-1] - first.markers_m[at, 1:-1], axis=2)
        for engine in others
        if (history := engine.result.rollout) is not None and history.markers_m.shape == first.markers_m.shape
    ]
    if apart:
        column = known(np.max(apart, axis=0))
        found[APART] = _coloured(APART, f"joint to {other}", display_unit("m"), column, style.stretch_map())
    return found


def _coloured(name: str, label: str, unit: Unit, values: Array, colours: Colormap) -> tuple[Colouring, Array]:
    shown = unit.factor * np.asarray(values, float)
    low, high = float(np.nanmin(shown, initial=0.0)), float(np.nanmax(shown, initial=0.0))
    limits = (low, high if high > low else low + 1.0)
    return Colouring(name, ChartAxis(label, unit.symbol).text, limits, ramp(colours)), shown


def _band(run: FinishedRun, shown: Rollout) -> Array | None:
    """Return (states, modules) half-width of the law's 90 % band over its slope: the uncertainty of the joint."""
    placed = module_designs(run)
    if placed is None or shown.actuation.shape[1] != 1:
        return None
    found = np.zeros(shown.joint_angles.shape[:2])
    for j, number in enumerate(placed[0]):
        law = run.designs[number].law
        p, u = shown.actuation[:, 0], shown.joint_angles[:, j]
        band, axis = law.band(p, u), main_axis(law)
        if band is None:
            return None
        slope = np.abs(law.evaluate(p, u).dtau_du[:, axis, axis])
        found[:, j] = np.where(slope > 0.0, band[:, axis] / np.maximum(slope, 1e-300), 0.0)
    return found


def _shaped(
    modules: ShapedModules, shown: Rollout, values: Mapping[str, Array]
) -> tuple[list[SceneSkin], list[SceneBody], float]:
    """Return a skin for each design and a body for each module, and the distance of the skin from its axis."""
    angles = shown.joint_angles[:, :, 0]
    placed = [modules.poses(float(p), q) for p, q in zip(shown.actuation[:, 0], angles, strict=True)]
    skins, levels = [], []
    for shapes, sections in zip(modules.shapes, modules.sections, strict=True):
        order = body.level_position(shapes, 0.0)[0]
        ordered = [sections[k] for k in order]
        skins.append(section_skin(ordered, {STRETCH: np.stack([s.values for s in ordered])}))
        levels.append(np.array([body.level_position(shapes, float(p))[1] for p in shown.actuation[:, 0]]))
    last, bodies = len(modules.designs) - 1, []
    for number, design in enumerate(modules.designs):
        bodies.append(
            SceneBody(
                design,
                _module_copies(number == 0, number == last),
                levels[design],
                angles[:, number] / 2,
                np.stack([rotations[number] for rotations, _, _ in placed]),
                np.stack([centres[number] for _, centres, _ in placed]),
                {name: column[:, number] for name, column in values.items()},
            )
        )
    thick = max(float(np.linalg.norm(skin.section_m[..., 1:], axis=-1).max()) for skin in skins)
    return skins, bodies, thick


def _module_copies(first: bool, last: bool) -> tuple[Copy, ...]:
    """Return both halves with their mirror images; lids only at the ends of the finger."""
    found = []
    for signs in mirror_signs(("x", "y")):
        found.append(Copy("sides", signs))
        if (first and signs[0] < 0) or (last and signs[0] > 0):
            found.append(Copy("end", signs))
    return tuple(found)


def _rods(
    shown: Rollout, values: Mapping[str, Array], base: Array
) -> tuple[list[SceneSkin], list[SceneBody], float]:
    """Return two rods for each joint, to the middle of the links before and after it."""
    markers = shown.markers_m
    joints = markers[:, 1:-1]
    between = (joints[:, :-1] + joints[:, 1:]) / 2
    ends = np.concatenate([markers[:, :1], between, markers[:, -1:]], axis=1)
    length = float(np.linalg.norm(np.diff(ends, axis=1), axis=2).mean())
    longest = 2.0 * float(np.linalg.norm(np.diff(markers, axis=1), axis=2).max())
    bodies = []
    for j in range(joints.shape[1]):
        for start, end in ((ends[:, j], joints[:, j]), (joints[:, j], ends[:, j + 1])):
            along = np.linalg.norm(end - start, axis=1)
            bodies.append(
                SceneBody(
                    0,
                    tuple(Copy(part) for part in ("sides", "start", "end")),
                    along / longest,
                    np.zeros(len(along)),
                    np.stack([_pointing(a, b, base) for a, b in zip(start, end, strict=True)]),
                    start,
                    {name: column[:, j] for name, column in values.items()},
                )
            )
    return [_rod(SLENDER * length, longest)], bodies, SLENDER * length


def _pointing(start: Array, end: Array, base: Array) -> Array:
    """Return (3, 3) the rotation whose x points from start to end, and whose y is as near to the base's as possible."""
    along = end - start
    size = float(np.linalg.norm(along))
    x = along / size if size > 0.0 else base[:, 0]
    y = base[:, 1] - (base[:, 1] @ x) * x
    y = y if np.linalg.norm(y) > 1e-6 else base[:, 2] - (base[:, 2] @ x) * x
    y = y / np.linalg.norm(y)
    return np.stack([x, y, np.cross(x, y)], axis=1)


def _rod(radius: float, longest: float) -> SceneSkin:
    """Return a round rod at the lengths 0 and `longest`, with its two ends."""
    angle = np.linspace(0, 2 * np.pi, 2 * SIDES + 1)
    ring = np.stack([np.zeros_like(angle), radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    shares = np.array([0.0, 0.5, 1.0])
    side = np.concatenate([ring + [share, 0, 0] for share in shares])
    lids = [np.concatenate([ring * share + [x, 0, 0] for share in shares]) for x in (0.0, 1.0)]
    points = np.concatenate([side, *lids])
    n = len(angle)
    faces = np.array([[n * b + 2 * k + a for b in range(3) for a in range(3)] for k in range(SIDES)])
    parts = {
        "sides": _outward(faces, points, ring=True),
        "start": _outward(faces + 3 * n, points, along=-1.0),
        "end": _outward(faces + 6 * n, points, along=1.0),
    }
    sections = np.stack([points * [reach, 1.0, 1.0] for reach in (0.0, longest)])
    return SceneSkin(sections, np.array([1e-9, longest]), parts)


def _outward(faces: IntArray, points: Array, ring: bool = False, along: float = 0.0) -> IntArray:
    """Return the faces, flipped where ∂x/∂a × ∂x/∂b of the first points inward."""
    corner = points[faces[0]]
    normal = np.cross(corner[5] - corner[3], corner[7] - corner[1])
    wanted = corner[4] * [0.0, 1.0, 1.0] if ring else np.array([along, 0.0, 0.0])
    return faces if float(normal @ wanted) > 0 else faces[:, TRANSPOSED]
