"""A scene as MJCF: arms on a carriage that is driven by its velocity, free objects, every pair that may touch."""

from __future__ import annotations

from pathlib import Path
from xml.etree.ElementTree import Comment, Element, SubElement, fromstring, indent, tostring

from pliant.records.scene import Arm, Scene
from pliant_export.written_law import has_form, identifier
from pliant_plugins.exporting.content import stiffness_at_rest
from pliant_plugins.exporting.mjcf import (
    IN_MODULE,
    NOWHERE,
    THE_LAW,
    add_inputs,
    add_sensors,
    add_sites,
    name_joints,
)
from pliant_plugins.exporting.mujoco_module import DrivenArm, module_text
from pliant_plugins.physics.mujoco.config import MujocoConfig
from pliant_plugins.physics.mujoco.mjcf import CARRIAGE_KG, scene_mjcf

# After one step the carriage's velocity deviates from the prescribed one by about one part in STIFF.
STIFF = 1e3


def write_scene(scene: Scene, path: Path, config: MujocoConfig) -> tuple[Path, ...]:
    """Write the scene at rest, and the module `<name>_law.py` if its laws have an exportable form.

    Names of arm k begin with `arm_k_`: bodies, joints, sites, sensors and one actuator for each input, such as
    `arm_0_pressure_pa`. The actuators `carriage_x`, `carriage_y`, `carriage_z` take the carriage's velocity, m/s.

    The integrator is the engine's own, which MuJoCo has from 3.13 on.
    """
    document, _ = scene_mjcf(scene, config)
    root = fromstring(document)
    has_module = all(has_form(arm.chain.laws) for arm in scene.arms)
    module = path.with_name(f"{identifier(path.stem)}_law.py")
    said = IN_MODULE.format(module=module.name) if has_module else NOWHERE
    root.insert(0, Comment(THE_LAW.format(rest=said)))
    option = _found(root, "option")
    option.set("timestep", repr(config.contact_timestep_s))
    actuator, sensor = SubElement(root, "actuator"), SubElement(root, "sensor")
    for axis, joint in zip("xyz", _found(root, ".//body[@name='carriage']").findall("joint"), strict=True):
        joint.set("name", f"carriage_{axis}")
        hold = repr(STIFF * CARRIAGE_KG / config.contact_timestep_s)
        SubElement(actuator, "velocity", name=f"carriage_{axis}", joint=f"carriage_{axis}", kv=hold)
    for number, arm in enumerate(scene.arms):
        _add_arm(root, arm, f"arm_{number}_", config.joint_damping)
        add_inputs(actuator, arm.chain, f"arm_{number}_")
        add_sensors(sensor, arm.chain, f"arm_{number}_")
    for number in range(len(scene.objects)):
        for kind, what in (("framepos", "position"), ("framequat", "attitude")):
            seen = SubElement(sensor, kind, name=f"object_{number}_{what}")
            seen.set("objtype", "xbody")
            seen.set("objname", f"object_{number}")
    indent(root)
    path.write_text(tostring(root, encoding="unicode") + "\n", encoding="utf-8")
    if not has_module:
        return (path,)
    arms = [DrivenArm(arm.chain, f"arm_{number}_") for number, arm in enumerate(scene.arms)]
    module.write_text(module_text(arms, path.name), encoding="utf-8")
    return path, module


def _add_arm(root: Element, arm: Arm, prefix: str, damping: float) -> None:
    """Add names, stiffness at rest and damping of an arm's joints, and its sites."""
    n = arm.chain.n_joints
    names = [f"{prefix}base", *(f"{prefix}body_{k}" for k in range(1, n + 1))]
    bodies = [_found(root, f".//body[@name='{name}']") for name in names]
    for number, (body, stiffness) in enumerate(zip(bodies[1:], stiffness_at_rest(arm.chain), strict=True), 1):
        name_joints(body, f"{prefix}joint_{number}", stiffness, damping)
    add_sites(bodies, prefix)


def _found(parent: Element, path: str) -> Element:
    found = parent.find(path)
    assert found is not None, path
    return found
