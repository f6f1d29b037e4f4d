"""A chain as URDF. The format has no stiffness: each joint's is written as a comment, its law to a separate JSON file.

Spherical joints are PyBullet's extension of the format.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree.ElementTree import Comment, Element, SubElement

import numpy as np

from pliant.errors import UserError
from pliant.records.chain import ChainModel
from pliant.records.design import MassProperties
from pliant_export.as_json import READER
from pliant_export.law_files import write_laws
from pliant_export.written_law import BALL_JOINT, has_form
from pliant_plugins.exporting.content import (
    THE_LAW,
    WITHOUT_FORM,
    SurfaceFiles,
    body_shapes,
    stiffness_at_rest,
)
from pliant_plugins.physics.pybullet.urdf import (
    CollisionWriter,
    add_joint,
    add_link,
    add_origin,
    add_primitive,
    chain_tree,
    document,
    floored,
    moving,
)


def write_urdf(chain: ChainModel, path: Path, looks: ChainModel | None = None) -> tuple[Path, ...]:
    """Write links `world`, `base`, `body_1`…`body_n`, `tip`; a fixed joint on `world` has the base's pose.

    A root link has no mass in most programs: that of the piece on the base is a separate link `base_piece`, the last
    one.

    Raises:
        UserError: joints that turn and extend, which URDF does not have.
    """
    if chain.laws[0].joint == "extensible":
        raise UserError(
            "URDF has no joint that turns and extends; write the robot as MJCF (a ball and a slide in each body), or "
            "take a family whose joints turn alone."
        )
    at_rest, surfaces = stiffness_at_rest(chain), SurfaceFiles(path)
    collisions = CollisionWriter(surfaces.folder, start=path.parent)
    root = chain_tree(floored(chain), collisions=collisions)
    root.insert(0, Comment(THE_LAW if has_form(chain.laws) else THE_LAW.replace(*WITHOUT_FORM)))
    if chain.laws[0].joint == "revolute" and len(chain.axes) > 1:
        root.insert(1, Comment(f" {' '.join(BALL_JOINT)} ".replace("--", "-")))
    add_link(root, "world", MassProperties.none())
    joint = add_joint(root, "base", "fixed", "world", "base")
    add_origin(joint, chain.base_position_m, np.asarray(chain.base_rotation, float))
    if chain.bodies[0].mass_kg > 0.0:
        add_link(root, "base_piece", moving(chain.bodies[0]))
        add_origin(add_joint(root, "base_piece", "fixed", "base", "base_piece"), np.zeros(3), np.eye(3))
    links = {link.get("name"): link for link in root.iter("link")}
    for body in range(chain.n_joints + 1):
        name = f"body_{body}" if body else "base"
        _dress(links[name], looks, body, surfaces, path.parent)
    unit = "N/m" if chain.laws[0].joint == "prismatic" else "N m/rad"
    for number, stiffness in enumerate(at_rest, start=1):
        hinge = root.find(f"joint[@name='joint_{number}']")
        assert hinge is not None
        rows = "; ".join(" ".join(f"{value:.9g}" for value in row) for row in stiffness)
        hinge.append(Comment(f" stiffness at rest about {' '.join(chain.axes)}: {rows} {unit} "))
    beside: tuple[Path, ...] = ()
    if has_form(chain.laws):
        reader = path.with_name("read_law.py")
        reader.write_text(READER, encoding="utf-8")
        beside = (*write_laws(chain.laws, path.with_name(f"{path.stem}_law.json"), "json"), reader)
    path.write_text(document(root) + "\n", encoding="utf-8")
    return (path, *beside, *surfaces.written, *collisions.written)


def _dress(link: Element, looks: ChainModel | None, body: int, surfaces: SurfaceFiles, start: Path) -> None:
    for shape in body_shapes(looks, body):
        visual = SubElement(link, "visual")
        add_origin(visual, shape.position_m, shape.rotation)
        geometry = SubElement(visual, "geometry")
        if not add_primitive(geometry, shape) and shape.mesh is not None:
            name = surfaces.file(shape.mesh).relative_to(start)
            SubElement(geometry, "mesh", filename=name.as_posix())
