"""The components that ship with Pliant. Nothing heavy is imported here; see `pliant.registry.component`."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from typing import Any

from pliant.registry.component import Component
from pliant.registry.hookspecs import hookimpl
from pliant_plugins.families.reference import (
    EXAMPLE_MESH,
    EXTENDING,
    FINGER,
    HELIX_MODULE,
    PNEUNET,
    TENDON_JOINT,
    THREE_CHAMBER,
    TWO_CHAMBER,
    WOUND_TUBE,
)

CONTRACT = 3
HERE = "pliant_plugins"
STUDY_LAW = {"k_n": 1.637e-6, "m_a": -1.704e-6, "b_a": 0.0, "m_e": 0.1012, "b_e": 0.0245}
NO_PYBULLET_WHEEL = (
    f"PyBullet has no wheel for Python {sys.version_info.major}.{sys.version_info.minor} "
    "(3.11 is the last); use Python 3.11, or physics 'quasistatic' or 'mujoco'"
)
PYBULLET = "pip install 'pliant[pybullet]'" if sys.version_info < (3, 12) else NO_PYBULLET_WHEEL


def _shipped(interface: str, kind: str, place: str, summary: str, config: str = "", **more: Any) -> Component:
    """Return a component of this package; the config of `module:Class` is `module:ClassConfig` if none is named."""
    return Component(
        interface, kind, f"{HERE}.{config or place + 'Config'}", f"{HERE}.{place}", summary, **more
    )


# Interface, kind, place, summary; place of another config, smallest block, what must be installed.
COMPONENTS = (
    # family
    _shipped(
        "family",
        "bellow_bending",
        "families.bellow_bending.family:BellowBending",
        "bellow with a strain-limiting plate on one side; pressure bends it",
        example=FINGER,
    ),
    _shipped(
        "family",
        "bellow_helical",
        "families.bellow_helical.family:BellowHelical",
        "bellow with a constraint inside along one side; pressure bends it, on three axes",
        example=HELIX_MODULE,
    ),
    _shipped(
        "family",
        "bellow_translational",
        "families.bellow_translational.family:BellowTranslational",
        "bellow without a constraint; pressure extends it",
        example=EXTENDING,
    ),
    _shipped(
        "family",
        "tendon_joint",
        "families.tendon_joint.family:TendonJoint",
        "rigid links with a soft flexure between them; a tendon below it bends it",
        example=TENDON_JOINT,
    ),
    _shipped(
        "family",
        "mesh_file",
        "families.mesh_file.family:MeshFile",
        "a module from a volume mesh of tetrahedra or hexahedra with named surfaces",
        example={"file": EXAMPLE_MESH, "unit": "mm", "part": "half", "symmetry": "symmetry"},
        requires=("meshio",),
        install="pip install 'pliant[fem]'",
    ),
    _shipped(
        "family",
        "pneunet",
        "families.pneunet.family:Pneunet",
        "chambers with thin walls on a strain-limiting layer of another material; pressure bends the row",
        example=PNEUNET,
    ),
    _shipped(
        "family",
        "fibre_reinforced",
        "families.fibre_reinforced.family:FibreReinforced",
        "tube wound with threads, with a sheet along one side; pressure bends it toward the sheet",
        example=WOUND_TUBE,
    ),
    _shipped(
        "family",
        "two_chamber",
        "families.chambers.two_chamber:TwoChamber",
        "two opposed chambers with a pressure each; bends both ways",
        example=TWO_CHAMBER,
    ),
    _shipped(
        "family",
        "three_chamber",
        "families.chambers.three_chamber:ThreeChamber",
        "three chambers around a bore with a pressure each; bends about two axes",
        example=THREE_CHAMBER,
    ),
    # material
    _shipped(
        "material",
        "neo_hookean",
        "materials.neo_hookean:NeoHookean",
        "nearly incompressible neo-Hookean rubber",
        example={"shear_modulus": "240 kPa"},
    ),
    _shipped(
        "material",
        "mooney_rivlin",
        "materials.mooney_rivlin:MooneyRivlin",
        "Mooney–Rivlin rubber of C10 and C01",
        example={"c10": "90 kPa", "c01": "30 kPa"},
    ),
    _shipped(
        "material",
        "yeoh",
        "materials.yeoh:Yeoh",
        "Yeoh rubber of C10, C20 and C30, which stiffens at large stretch",
        example={"c10": "120 kPa", "c20": "-4 kPa", "c30": "1.5 kPa"},
    ),
    _shipped(
        "material",
        "ogden",
        "materials.ogden:Ogden",
        "Ogden rubber of powers of the principal stretches, in Abaqus' convention",
        example={"mu": ["200 kPa", "40 kPa"], "alpha": [1.8, -2.5]},
    ),
    _shipped(
        "material",
        "named",
        "materials.named:Named",
        "silicones and rubbers by name, such as Ecoflex 00-30, or by Shore hardness",
        example={"name": "Ecoflex 00-30"},
    ),
    # fem
    _shipped(
        "fem",
        "skfem",
        "fem.skfem.backend:Skfem",
        "scikit-fem discretisation in a bend frame, exact slopes, pardiso or SuperLU",
        config="fem.config:SkfemConfig",
        example={"pressure_max": "15 kPa"},
        requires=("skfem",),
        install="pip install 'pliant[fem]'",
    ),
    _shipped(
        "fem",
        "ngsolve",
        "fem.ngsolve.backend:Ngsolve",
        "NGSolve: Taylor–Hood elements and differentiated energies, an independent check",
        config="fem.config:NgsolveConfig",
        example={"pressure_max": "15 kPa", "order": 2},
        requires=("ngsolve",),
        install="pip install 'pliant[ngsolve]'",
    ),
    # surrogate
    _shipped(
        "surrogate",
        "polynomial",
        "surrogates.polynomial.surrogate:Polynomial",
        "polynomial law of adaptive degree from values and slopes, or the published form",
        config="surrogates.config:PolynomialConfig",
        example={"form": "study", "coefficients": STUDY_LAW, "odd": True},
    ),
    _shipped(
        "surrogate",
        "table",
        "surrogates.table.surrogate:TableSurrogate",
        "measurements or FEM from elsewhere, interpolated and smoothed as far as they scatter",
        config="surrogates.config:TableConfig",
    ),
    _shipped(
        "surrogate",
        "neural",
        "surrogates.neural.surrogate:Neural",
        "small network of an energy, trained on values and slopes, of one to three axes",
        config="surrogates.config:NeuralConfig",
        example={"units": 16},
        lazy=("torch",),
        install="pip install 'pliant[neural]'",
    ),
    # physics
    _shipped(
        "physics",
        "quasistatic",
        "physics.quasistatic.backend:Quasistatic",
        "equilibria by Newton with exact Jacobian; residual and stability reported",
        config="physics.quasistatic.config:QuasistaticConfig",
    ),
    _shipped(
        "physics",
        "mujoco",
        "physics.mujoco.backend:Mujoco",
        "MuJoCo dynamics, implicit in the laws' stiffness",
        config="physics.mujoco.config:MujocoConfig",
        requires=("mujoco",),
        install="pip install 'pliant[mujoco]'",
    ),
    _shipped(
        "physics",
        "pybullet",
        "physics.pybullet.backend:Pybullet",
        "Bullet multibody dynamics, an independent check",
        config="physics.pybullet.config:PybulletConfig",
        requires=("pybullet",),
        install=PYBULLET,
    ),
    # task
    _shipped(
        "task",
        "free_bending",
        "tasks.ramp:FreeBending",
        "actuate the chain and let it settle",
        example={"pressure": "15 kPa"},
    ),
    _shipped(
        "task",
        "helical_hang",
        "tasks.helical_hang:HelicalHang",
        "actuate the chain, then hang one weight after the other at its tip",
        example={"pressure": "15 kPa", "loads": ["0 g", "10 g"]},
    ),
    _shipped(
        "task",
        "tendon_finger",
        "tasks.tendon_finger:TendonFinger",
        "pull the tendon by a force or by a travel, against a weight over a pulley",
        example={"tendon_force": "8 N", "payload": "20 g"},
    ),
    _shipped(
        "task",
        "follow_shape",
        "tasks.follow_shape:FollowShape",
        "distance of the settled backbone to a target curve, by normalised arc length",
        example={"pressure": "15 kPa", "target": {"radius": "18 mm", "height": "60 mm"}},
    ),
    _shipped(
        "task",
        "reach",
        "tasks.reach:Reach",
        "find the actuations that bring tip, direction or backbone to a target, or along a path",
        example={"tip": ["20 mm", "0 mm", "-70 mm"], "bounds": {"pressure_pa": ["0 kPa", "15 kPa"]}},
    ),
    _shipped(
        "task",
        "follow_pressure",
        "tasks.follow_pressure:FollowPressure",
        "actuate the chain in time: free swings, step response, frequency response",
        example={"pressure": "15 kPa", "waveform": "step", "duration": "0.2 s", "record": "20 ms"},
    ),
    _shipped(
        "task",
        "tip_load",
        "tasks.ramp:TipLoad",
        "actuate the chain with a payload or a force at its tip",
        example={"pressure": "15 kPa", "payload": "13 g"},
    ),
    _shipped(
        "task",
        "reach_around",
        "tasks.reach_around.task:ReachAround",
        "bring the tips of one or several chains to targets behind fixed obstacles",
        config="tasks.reach_around.config:ReachAroundConfig",
        example={
            "arms": [{"tip": ["20 mm", "0 mm", "-70 mm"]}],
            "obstacles": [{"sphere": "5 mm", "position": ["30 mm", "0 mm", "-30 mm"]}],
            "bounds": {"pressure_pa": ["0 kPa", "15 kPa"]},
        },
    ),
    _shipped(
        "task",
        "push",
        "tasks.push.task:Push",
        "press on a wall: holding force and stiffness over the wall's place and the actuation",
        config="tasks.push.config:PushConfig",
        example={"pressure": "8 kPa", "wall": {"position": ["15 mm", "0 mm", "0 mm"], "normal": [-1, 0, 0]}},
    ),
    _shipped(
        "task",
        "hold_and_turn",
        "tasks.hold_and_turn.task:HoldAndTurn",
        "hold an object with fingers and turn it in the hand",
        config="tasks.hold_and_turn.config:HoldAndTurnConfig",
        example={
            "object": "cylinder",
            "pressure": "8 kPa",
            "turn": {"keyframes": [{"time": "0.2 s", "inputs": [{"pressure_pa": "9 kPa"}]}]},
        },
        lazy=("trimesh",),
        install="pip install 'pliant[grasp]'",
    ),
    _shipped(
        "task",
        "crawl",
        "tasks.crawl.task:Crawl",
        "crawl over a floor under periodic actuation: speed and cost of transport",
        config="tasks.crawl.config:CrawlConfig",
        example={"gait": {"pressure_pa": {"low": "2 kPa", "high": "8 kPa"}}, "period": "0.5 s"},
    ),
    _shipped(
        "task",
        "grasp",
        "tasks.grasp.task:Grasp",
        "lower fingers over an object, actuate them and lift it",
        config="tasks.grasp.config:GraspConfig",
        example={"object": "egg", "pressure": "15 kPa"},
        lazy=("trimesh",),
        install="pip install 'pliant[grasp]'",
    ),
)
EFFECTS = {
    "stiffness": "the joint is stiffer or softer than the model says",
    "actuation_gain": "the drive acts by another factor than the model says",
    "pressure_offset": "the pressure gauge is off by a constant",
    "dead_zone": "the lowest pressures do nothing",
    "supply_lag": "the supply answers late",
    "viscous_damping": "the joint damps its own motion",
    "viscoelastic": "the material creeps and relaxes",
    "friction_hysteresis": "the joint rubs",
    "mullins": "the material has softened by what it was stretched to",
    "permanent_set": "the joint does not come back all the way",
    "gravity_scale": "the chain weighs more or less than the model says",
    "self_contact": "walls touch beyond an angle",
    "thermal_softening": "the stiffness changes with the temperature",
    "sensor_bias": "the angle sensor is off by a constant",
    "wall_thickness": "the walls are thicker or thinner than the model's",
    "leak": "a closed chamber loses gas",
    "bimodulus": "the joint is stiffer one way than the other",
    "inertia": "the chain's own mass swings",
    "tendon_friction": "the tendon rubs where it bends",
    "sensor_scale": "the angle sensor is off by a factor",
    "sensor_lag": "the angle is read late",
    "backlash": "the angle sensor has play",
    "base_misalignment": "the base is mounted tilted",
    "inter_module_compliance": "the connections between modules give",
    "cross_axis": "the modules bend about a turned axis",
    "end_restraint": "clamp and cap hold the end modules back",
    "link_stretch": "pressure lengthens the chain",
    "payload_error": "the payload was written down wrongly",
    "load_error": "the load at the tip was written down wrongly",
    "clock_offset": "the clocks of inputs and readings are apart",
    "clock_drift": "the clocks of inputs and readings run at different rates",
    "gravity_error": "gravity was stated wrongly",
    "tendon_slack": "a tendon that is paid out goes slack",
    "unequal_actuators": "chambers or tendons do not act alike",
    "learned": "what no listed effect explains follows a smooth curve",
}
# Examples of the other effects are given with the parameters in their configs.
LEARNED = {
    "acts_on": "moment",
    "covariates": [{"name": "angle", "low": -0.1, "high": 0.5}],
    "value": [0, 0.0004, -0.0002, -0.0006],
}


@hookimpl
def pliant_components() -> Iterable[Component]:
    """Return all built-in components."""
    return [*COMPONENTS, *(_effect(kind, summary) for kind, summary in EFFECTS.items())]


def _effect(kind: str, summary: str) -> Component:
    """Return an effect, whose module has its name: dead_zone is `effects.dead_zone:DeadZone`."""
    place = f"effects.{kind}:{''.join(map(str.capitalize, kind.split('_')))}"
    return _shipped("effect", kind, place, summary, example=LEARNED if kind == "learned" else {})
