"""A chain as MJCF: surfaces, collision shapes, inputs, sites, sensors, and a Python module that applies the laws.

The file alone has the laws' stiffness at rest and moves as a passive spring; the module removes that stiffness.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from xml.etree.ElementTree import Comment, Element, SubElement, indent, tostring

import numpy as np

from pliant.inverse.limits import input_range
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.shape import Shape
from pliant_export.written_law import has_form, identifier
from pliant_plugins.exporting.content import SurfaceFiles, body_shapes, stiffness_at_rest
from pliant_plugins.exporting.mujoco_module import DrivenArm, module_text
from pliant_plugins.physics.mujoco.mjcf import (
    JOINT_TYPES,
    add_base_inertia,
    add_chain,
    placed,
    text,
)

SEEN, TOUCHED = "2", "3"  # MuJoCo's usual groups: visuals are shown, collision shapes are not
TIMESTEP_S, SITE_M = 0.005, "0.001"
# Suffix of a joint's name for the slide that is combined with its ball.
EXTENDS = "_extension"
THE_LAW = (
    " Written by Pliant. The joint law is not in this file, which alone is a spring with the law's stiffness at rest: "
    "{rest} SI units. "
)
IN_MODULE = (
    "it is in {module} beside it, whose load() or install(model) lets it act; data.ctrl then takes inputs."
)
NOWHERE = "it has no form that other languages can take."


def write_mjcf(
    chain: ChainModel, path: Path, looks: ChainModel | None = None, damping: float = 0.0
) -> tuple[Path, ...]:
    """Write bodies `base`, `body_1`…`body_n`, `tip` and joints `joint_1`…`joint_n` with viscous `damping`.

    A joint that also extends has a slide `joint_k_extension` behind its ball. A ball joint of MuJoCo has one stiffness:
    the mean of the law's three. The chain does not collide with itself. Its inputs are actuators of the same names that
    apply no force; the module `<name>_law.py` reads them. Laws without a scalar form get no module.
    """
    at_rest, surfaces = stiffness_at_rest(chain), SurfaceFiles(path)
    module = path.with_name(f"{identifier(path.stem)}_law.py")
    driving = module_text([DrivenArm(chain)], path.name) if has_form(chain.laws) else ""
    root = Element(
        "mujoco", model="chain"
    )  # no compiler settings: an <include> would make them those of the whole
    root.insert(0, Comment(THE_LAW.format(rest=IN_MODULE.format(module=module.name) if driving else NOWHERE)))
    option = SubElement(root, "option", integrator="implicitfast", gravity=text(chain.gravity_m_s2))
    option.set("timestep", repr(TIMESTEP_S))
    assets, known = SubElement(root, "asset"), set[str]()

    def add(body: Element, shapes: Iterable[Shape], **how: str) -> None:
        for shape in shapes:
            geom = SubElement(body, "geom", {**placed(shape), "mass": "0", **how})
            if shape.mesh is None:
                geom.set("size", text(shape.size_m))
                continue
            surface = surfaces.file(shape.mesh)
            geom.set("mesh", surface.stem)
            if surface.stem not in known:
                known.add(surface.stem)
                # A half module is open where it meets its other half: as a shell it needs no volume.
                file = surface.relative_to(path.parent).as_posix()
                SubElement(assets, "mesh", name=surface.stem, file=file, inertia="shell")

    bodies = add_chain(SubElement(root, "worldbody"), chain)
    add_base_inertia(bodies[0], chain)
    for number, body in enumerate(bodies):
        add(body, body_shapes(looks, number), group=SEEN, contype="0", conaffinity="0")
        add(body, body_shapes(chain, number), group=TOUCHED, contype="1", conaffinity="0")
    for number, (body, stiffness) in enumerate(zip(bodies[1:], at_rest, strict=True), start=1):
        name_joints(body, f"joint_{number}", stiffness, damping)
    add_sites(bodies)
    add_inputs(SubElement(root, "actuator"), chain)
    add_sensors(SubElement(root, "sensor"), chain)
    indent(root)
    path.write_text(tostring(root, encoding="unicode") + "\n", encoding="utf-8")
    if not driving:
        return (path, *surfaces.written)
    module.write_text(driving, encoding="utf-8")
    return (path, module, *surfaces.written)


def name_joints(body: Element, name: str, stiffness: Array, damping: float) -> None:
    """Set name, stiffness at rest (a, a) and damping of a body's joint and of its slide if it has one."""
    joint, *slides = body.findall("joint")
    turns = np.diag(stiffness)[: len(stiffness) - len(slides)]
    for one, ending, value in (
        (joint, "", np.mean(turns)),
        *((s, EXTENDS, stiffness[-1, -1]) for s in slides),
    ):
        one.set("name", name + ending)
        one.set("stiffness", repr(float(value)))
        one.set("damping", repr(damping))


def add_sites(bodies: Sequence[Element], prefix: str = "") -> None:
    """Add sites `base`, `marker_1`…`marker_n` at the joints, `tip`."""
    for number, body in enumerate(bodies):
        SubElement(body, "site", name=f"{prefix}marker_{number}" if number else f"{prefix}base", size=SITE_M)
    tip = bodies[-1].find("body")
    assert tip is not None
    SubElement(tip, "site", name=f"{prefix}tip", size=SITE_M)


def add_inputs(actuator: Element, chain: ChainModel, prefix: str = "") -> None:
    """Add one actuator without force for each input; its range, where all laws have data, is no limit."""
    for name in dict.fromkeys(one.input for one in chain.actuators):
        added = SubElement(
            actuator, "general", name=prefix + name, site=f"{prefix}tip", gainprm="0", biastype="none"
        )
        low, high = input_range(chain, name)
        if np.isfinite([low, high]).all() and low < high:
            added.set("ctrlrange", text([low, high]))
            added.set("ctrllimited", "false")


def add_sensors(sensor: Element, chain: ChainModel, prefix: str = "") -> None:
    """Add sensors of the tip's position and attitude and of every joint's coordinate and rate."""
    SubElement(sensor, "framepos", name=f"{prefix}tip_position", objtype="site", objname=f"{prefix}tip")
    SubElement(sensor, "framequat", name=f"{prefix}tip_attitude", objtype="site", objname=f"{prefix}tip")
    ball, *slides = JOINT_TYPES[chain.laws[0].joint]
    plain = ("jointpos", "jointvel")
    first = ("ballquat", "ballangvel") if ball == "ball" else plain
    for kinds, ending in ((first, ""), *((plain, EXTENDS) for _ in slides)):
        for kind, name in zip(kinds, ("position", "velocity"), strict=True):
            for k in range(1, chain.n_joints + 1):
                joint = f"{prefix}joint_{k}{ending}"
                SubElement(sensor, kind, name=f"{joint}_{name}", joint=joint)
