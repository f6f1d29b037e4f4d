"""The components that ship with Pliant. Nothing heavy is imported here; see `pliant.registry.component`."""

from __future__ import annotations

import sys
from collections.abc import Iterable

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

CONTRACT = 2
HERE = "pliant_plugins"
STUDY_LAW = {"k_n": 1.637e-6, "m_a": -1.704e-6, "b_a": 0.0, "m_e": 0.1012, "b_e": 0.0245}
NO_PYBULLET_WHEEL = (
    f"PyBullet has no wheel for Python {sys.version_info.major}.{sys.version_info.minor} "
    "(3.11 is the last); use Python 3.11, or physics 'quasistatic' or 'mujoco'"
)


@hookimpl
def pliant_components() -> Iterable[Component]:
    """All built-in components."""
    return [*_modules(), *_meta_models(), *_engines(), *_effects(), *_viewers(), *_optimizers()]


def _modules() -> list[Component]:
    return [
        Component(
            interface="family",
            kind="bellow_bending",
            config=f"{HERE}.families.bellow_bending.family:BellowBendingConfig",
            implementation=f"{HERE}.families.bellow_bending.family:BellowBending",
            summary="bellow with a strain-limiting plate on one side; pressure bends it",
            example=FINGER,
        ),
        Component(
            interface="family",
            kind="bellow_helical",
            config=f"{HERE}.families.bellow_helical.family:BellowHelicalConfig",
            implementation=f"{HERE}.families.bellow_helical.family:BellowHelical",
            summary="bellow with a constraint inside along one side; pressure bends it, on three axes",
            example=HELIX_MODULE,
        ),
        Component(
            interface="family",
            kind="bellow_translational",
            config=f"{HERE}.families.bellow_translational.family:BellowTranslationalConfig",
            implementation=f"{HERE}.families.bellow_translational.family:BellowTranslational",
            summary="bellow without a constraint; pressure extends it",
            example=EXTENDING,
        ),
        Component(
            interface="family",
            kind="tendon_joint",
            config=f"{HERE}.families.tendon_joint.family:TendonJointConfig",
            implementation=f"{HERE}.families.tendon_joint.family:TendonJoint",
            summary="rigid links with a soft flexure between them; a tendon below it bends it",
            example=TENDON_JOINT,
        ),
        Component(
            interface="family",
            kind="mesh_file",
            config=f"{HERE}.families.mesh_file.family:MeshFileConfig",
            implementation=f"{HERE}.families.mesh_file.family:MeshFile",
            summary="a module from a volume mesh of tetrahedra or hexahedra with named surfaces",
            example={"file": EXAMPLE_MESH, "unit": "mm", "part": "half", "symmetry": "symmetry"},
            requires=("meshio",),
            install="pip install 'pliant[fem]'",
        ),
        Component(
            interface="family",
            kind="pneunet",
            config=f"{HERE}.families.pneunet.family:PneunetConfig",
            implementation=f"{HERE}.families.pneunet.family:Pneunet",
            summary="chambers with thin walls on a strain-limiting layer of another material; pressure bends the row",
            example=PNEUNET,
        ),
        Component(
            interface="family",
            kind="fibre_reinforced",
            config=f"{HERE}.families.fibre_reinforced.family:FibreReinforcedConfig",
            implementation=f"{HERE}.families.fibre_reinforced.family:FibreReinforced",
            summary="tube wound with threads, with a sheet along one side; pressure bends it toward the sheet",
            example=WOUND_TUBE,
        ),
        Component(
            interface="family",
            kind="two_chamber",
            config=f"{HERE}.families.chambers.two_chamber:TwoChamberConfig",
            implementation=f"{HERE}.families.chambers.two_chamber:TwoChamber",
            summary="two opposed chambers with a pressure each; bends both ways",
            example=TWO_CHAMBER,
        ),
        Component(
            interface="family",
            kind="three_chamber",
            config=f"{HERE}.families.chambers.three_chamber:ThreeChamberConfig",
            implementation=f"{HERE}.families.chambers.three_chamber:ThreeChamber",
            summary="three chambers around a bore with a pressure each; bends about two axes",
            example=THREE_CHAMBER,
        ),
        Component(
            interface="material",
            kind="neo_hookean",
            config=f"{HERE}.materials.neo_hookean:NeoHookeanConfig",
            implementation=f"{HERE}.materials.neo_hookean:NeoHookean",
            summary="nearly incompressible neo-Hookean rubber",
            example={"shear_modulus": "240 kPa"},
        ),
        Component(
            interface="material",
            kind="mooney_rivlin",
            config=f"{HERE}.materials.mooney_rivlin:MooneyRivlinConfig",
            implementation=f"{HERE}.materials.mooney_rivlin:MooneyRivlin",
            summary="Mooney–Rivlin rubber of C10 and C01",
            example={"c10": "90 kPa", "c01": "30 kPa"},
        ),
        Component(
            interface="material",
            kind="yeoh",
            config=f"{HERE}.materials.yeoh:YeohConfig",
            implementation=f"{HERE}.materials.yeoh:Yeoh",
            summary="Yeoh rubber of C10, C20 and C30, which stiffens at large stretch",
            example={"c10": "120 kPa", "c20": "-4 kPa", "c30": "1.5 kPa"},
        ),
        Component(
            interface="material",
            kind="ogden",
            config=f"{HERE}.materials.ogden:OgdenConfig",
            implementation=f"{HERE}.materials.ogden:Ogden",
            summary="Ogden rubber of powers of the principal stretches, in Abaqus' convention",
            example={"mu": ["200 kPa", "40 kPa"], "alpha": [1.8, -2.5]},
        ),
        Component(
            interface="fem",
            kind="skfem",
            config=f"{HERE}.fem.config:SkfemConfig",
            implementation=f"{HERE}.fem.skfem.backend:Skfem",
            summary="scikit-fem discretisation in a bend frame, exact slopes, pardiso or SuperLU",
            example={"pressure_max": "15 kPa"},
            requires=("skfem",),
            install="pip install 'pliant[fem]'",
        ),
        Component(
            interface="fem",
            kind="ngsolve",
            config=f"{HERE}.fem.config:NgsolveConfig",
            implementation=f"{HERE}.fem.ngsolve.backend:Ngsolve",
            summary="NGSolve: Taylor–Hood elements and differentiated energies, an independent check",
            example={"pressure_max": "15 kPa", "order": 2},
            requires=("ngsolve",),
            install="pip install 'pliant[ngsolve]'",
        ),
        Component(
            interface="surrogate",
            kind="polynomial",
            config=f"{HERE}.surrogates.config:PolynomialConfig",
            implementation=f"{HERE}.surrogates.polynomial.surrogate:Polynomial",
            summary="polynomial law of adaptive degree from values and slopes, or the study's form",
            example={"form": "study", "coefficients": STUDY_LAW, "odd": True},
        ),
        Component(
            interface="surrogate",
            kind="table",
            config=f"{HERE}.surrogates.config:TableConfig",
            implementation=f"{HERE}.surrogates.table.surrogate:TableSurrogate",
            summary="measurements or FEM from elsewhere, interpolated and smoothed as far as they scatter",
        ),
        Component(
            interface="surrogate",
            kind="neural",
            config=f"{HERE}.surrogates.config:NeuralConfig",
            implementation=f"{HERE}.surrogates.neural.surrogate:Neural",
            summary="small network of an energy, trained on values and slopes, of one to three axes",
            example={"units": 16},
            lazy=("torch",),
            install="pip install 'pliant[neural]'",
        ),
    ]


def _meta_models() -> list[Component]:
    return [
        Component(
            interface="meta_model",
            kind="regression",
            config=f"{HERE}.meta_models.config:RegressionConfig",
            implementation=f"{HERE}.meta_models.regression:Regression",
            summary="Gaussian processes, kernel ridge or polynomials of the design, whichever does better",
            example={"regressor": "gaussian_process"},
            requires=("sklearn",),
            install="pip install 'pliant[meta]'",
        ),
        Component(
            interface="meta_model",
            kind="coefficients",
            config=f"{HERE}.meta_models.config:CoefficientsConfig",
            implementation=f"{HERE}.meta_models.coefficients:Coefficients",
            summary="network 64-64-32 from the design to the coefficients of its law",
            example={"starts": 2},
            requires=("torch",),
            install="pip install 'pliant[neural]'",
        ),
        Component(
            interface="meta_model",
            kind="neural",
            config=f"{HERE}.meta_models.config:NeuralMetaConfig",
            implementation=f"{HERE}.meta_models.neural:NeuralMetaModel",
            summary="one network of design, actuation and deformation: an energy, or torques as in the study",
            example={"units": 16, "steps": 200},
            requires=("torch",),
            install="pip install 'pliant[neural]'",
        ),
    ]


def _engines() -> list[Component]:
    pybullet = "pip install 'pliant[pybullet]'" if sys.version_info < (3, 12) else NO_PYBULLET_WHEEL
    return [
        Component(
            interface="physics",
            kind="quasistatic",
            config=f"{HERE}.physics.quasistatic.config:QuasistaticConfig",
            implementation=f"{HERE}.physics.quasistatic.backend:Quasistatic",
            summary="equilibria by Newton with exact Jacobian; residual and stability reported",
        ),
        Component(
            interface="physics",
            kind="mujoco",
            config=f"{HERE}.physics.mujoco.config:MujocoConfig",
            implementation=f"{HERE}.physics.mujoco.backend:Mujoco",
            summary="MuJoCo dynamics, implicit in the laws' stiffness",
            requires=("mujoco",),
            install="pip install 'pliant[mujoco]'",
        ),
        Component(
            interface="physics",
            kind="pybullet",
            config=f"{HERE}.physics.pybullet.config:PybulletConfig",
            implementation=f"{HERE}.physics.pybullet.backend:Pybullet",
            summary="Bullet multibody dynamics, an independent check",
            requires=("pybullet",),
            install=pybullet,
        ),
        Component(
            interface="task",
            kind="free_bending",
            config=f"{HERE}.tasks.ramp:FreeBendingConfig",
            implementation=f"{HERE}.tasks.ramp:FreeBending",
            summary="actuate the chain and let it settle",
            example={"pressure": "15 kPa"},
        ),
        Component(
            interface="task",
            kind="helical_hang",
            config=f"{HERE}.tasks.helical_hang:HelicalHangConfig",
            implementation=f"{HERE}.tasks.helical_hang:HelicalHang",
            summary="actuate the chain, then hang one weight after the other at its tip",
            example={"pressure": "15 kPa", "loads": ["0 g", "10 g"]},
        ),
        Component(
            interface="task",
            kind="tendon_finger",
            config=f"{HERE}.tasks.tendon_finger:TendonFingerConfig",
            implementation=f"{HERE}.tasks.tendon_finger:TendonFinger",
            summary="pull the tendon by a force or by a travel, against a weight over a pulley",
            example={"tendon_force": "8 N", "payload": "20 g"},
        ),
        Component(
            interface="task",
            kind="follow_shape",
            config=f"{HERE}.tasks.follow_shape:FollowShapeConfig",
            implementation=f"{HERE}.tasks.follow_shape:FollowShape",
            summary="distance of the settled backbone to a target curve, by normalised arc length",
            example={"pressure": "15 kPa", "target": {"radius": "18 mm", "height": "60 mm"}},
        ),
        Component(
            interface="task",
            kind="reach",
            config=f"{HERE}.tasks.reach:ReachConfig",
            implementation=f"{HERE}.tasks.reach:Reach",
            summary="find the actuations that bring tip, direction or backbone to a target, or along a path",
            example={"tip": ["20 mm", "0 mm", "-70 mm"], "bounds": {"pressure_pa": ["0 kPa", "15 kPa"]}},
        ),
        Component(
            interface="task",
            kind="follow_pressure",
            config=f"{HERE}.tasks.follow_pressure:FollowPressureConfig",
            implementation=f"{HERE}.tasks.follow_pressure:FollowPressure",
            summary="actuate the chain in time: free swings, step response, frequency response",
            example={"pressure": "15 kPa", "waveform": "step", "duration": "0.2 s", "record": "20 ms"},
        ),
        Component(
            interface="task",
            kind="tip_load",
            config=f"{HERE}.tasks.ramp:TipLoadConfig",
            implementation=f"{HERE}.tasks.ramp:TipLoad",
            summary="actuate the chain with a payload or a force at its tip",
            example={"pressure": "15 kPa", "payload": "13 g"},
        ),
        Component(
            interface="task",
            kind="grasp",
            config=f"{HERE}.tasks.grasp.config:GraspConfig",
            implementation=f"{HERE}.tasks.grasp.task:Grasp",
            summary="lower fingers over an object, actuate them and lift it",
            example={"object": "egg", "pressure": "15 kPa"},
            lazy=("trimesh",),
            install="pip install 'pliant[grasp]'",
        ),
    ]


def _viewers() -> list[Component]:
    return [
        Component(
            interface="viewer",
            kind="mujoco",
            config=f"{HERE}.viewing.config:MujocoViewerConfig",
            implementation=f"{HERE}.viewing.backend:MujocoViewer",
            summary="MuJoCo's renderer and its interactive window, for the results of every engine",
            requires=("mujoco",),
            install="pip install 'pliant[mujoco]'",
        )
    ]


def _optimizers() -> list[Component]:
    return [
        Component(
            interface="optimizer",
            kind="cmaes",
            config=f"{HERE}.optimizers.config:CmaesConfig",
            implementation=f"{HERE}.optimizers.cmaes.optimizer:Cmaes",
            summary="CMA-ES by pycma: one objective, some hundreds of candidates or more",
            requires=("cma",),
            install="pip install 'pliant[search]'",
        ),
        Component(
            interface="optimizer",
            kind="optuna",
            config=f"{HERE}.optimizers.config:OptunaConfig",
            implementation=f"{HERE}.optimizers.optuna.optimizer:Optuna",
            summary="Optuna's samplers (TPE, NSGA-II, Gaussian process, …), with its dashboard; several objectives",
            requires=("optuna",),
            install="pip install 'pliant[search]'",
        ),
        Component(
            interface="optimizer",
            kind="ppo",
            config=f"{HERE}.optimizers.config:PpoConfig",
            implementation=f"{HERE}.optimizers.ppo.optimizer:Ppo",
            summary="PPO by stable-baselines3: learns which design suits which condition, from thousands of candidates",
            requires=("stable_baselines3", "torch", "tensorboard"),
            install="pip install 'pliant[ppo]'",
        ),
    ]


def _effects() -> list[Component]:
    summaries = {
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
        "learned": "what no listed effect explains follows a smooth curve",
    }
    # The others' examples stand with the parameters in their configs.
    curve = {
        "acts_on": "moment",
        "covariates": [{"name": "angle", "low": -0.1, "high": 0.5}],
        "value": [0, 0.0004, -0.0002, -0.0006],
    }
    return [
        Component(
            interface="effect",
            kind=kind,
            config=f"{HERE}.effects.{kind}:{_class_name(kind)}Config",
            implementation=f"{HERE}.effects.{kind}:{_class_name(kind)}",
            summary=summary,
            example=curve if kind == "learned" else {},
        )
        for kind, summary in summaries.items()
    ]


def _class_name(kind: str) -> str:
    """Of an effect: dead_zone is DeadZone."""
    return "".join(map(str.capitalize, kind.split("_")))
