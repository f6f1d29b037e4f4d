"""A chain as MJCF: surfaces to look at, shapes that collide, joints with the law's stiffness at rest."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from xml.etree.ElementTree import Comment, Element, SubElement, indent, tostring

import numpy as np

from pliant.records.chain import ChainModel
from pliant.records.shape import Shape
from pliant_plugins.exporting.content import THE_LAW, SurfaceFiles, shapes_of, stiffness_at_rest
from pliant_plugins.physics.mujoco.mjcf import add_chain, document, placed, text

SEEN, TOUCHED = "2", "3"  # MuJoCo's usual groups: visuals are shown, collision shapes are not


def write_mjcf(
    chain: ChainModel, path: Path, looks: ChainModel | None = None, damping: float = 0.0
) -> tuple[Path, ...]:
    """Bodies `base`, `body_1`…`body_n`, `tip`, joints `joint_1`…`joint_n` with viscous `damping`.

    A ball joint of MuJoCo has one stiffness: the mean of the law's three. The chain does not collide with itself.
    """
    surfaces = SurfaceFiles(path)
    root = document("chain")
    root.insert(0, Comment(THE_LAW))
    SubElement(root, "option", integrator="implicitfast", gravity=text(chain.gravity_m_s2))
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
    for number, body in enumerate(bodies):
        add(body, shapes_of(looks, number), group=SEEN, contype="0", conaffinity="0")
        add(body, shapes_of(chain, number), group=TOUCHED, contype="1", conaffinity="0")
    joints = [joint for body in bodies for joint in body.findall("joint")]
    for number, (joint, stiffness) in enumerate(zip(joints, stiffness_at_rest(chain), strict=True), start=1):
        joint.set("name", f"joint_{number}")
        joint.set("stiffness", repr(float(np.mean(np.diag(stiffness)))))
        joint.set("damping", repr(damping))
    indent(root)
    path.write_text(tostring(root, encoding="unicode") + "\n", encoding="utf-8")
    return (path, *surfaces.written)
