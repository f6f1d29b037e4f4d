"""The configs of the shipped plugins, for studies that are composed in Python.

    from pliant_plugins.configs import BellowBendingConfig, NeoHookeanConfig

Each is imported when it is first asked for; docs/reference lists their fields.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pliant_plugins.effects.actuation_gain import ActuationGainConfig as ActuationGainConfig
    from pliant_plugins.effects.backlash import BacklashConfig as BacklashConfig
    from pliant_plugins.effects.base_misalignment import BaseMisalignmentConfig as BaseMisalignmentConfig
    from pliant_plugins.effects.bimodulus import BimodulusConfig as BimodulusConfig
    from pliant_plugins.effects.clock_drift import ClockDriftConfig as ClockDriftConfig
    from pliant_plugins.effects.clock_offset import ClockOffsetConfig as ClockOffsetConfig
    from pliant_plugins.effects.cross_axis import CrossAxisConfig as CrossAxisConfig
    from pliant_plugins.effects.dead_zone import DeadZoneConfig as DeadZoneConfig
    from pliant_plugins.effects.end_restraint import EndRestraintConfig as EndRestraintConfig
    from pliant_plugins.effects.friction_hysteresis import (
        FrictionHysteresisConfig as FrictionHysteresisConfig,
    )
    from pliant_plugins.effects.gravity_error import GravityErrorConfig as GravityErrorConfig
    from pliant_plugins.effects.gravity_scale import GravityScaleConfig as GravityScaleConfig
    from pliant_plugins.effects.inertia import InertiaConfig as InertiaConfig
    from pliant_plugins.effects.inter_module_compliance import (
        InterModuleComplianceConfig as InterModuleComplianceConfig,
    )
    from pliant_plugins.effects.leak import LeakConfig as LeakConfig
    from pliant_plugins.effects.learned import LearnedConfig as LearnedConfig
    from pliant_plugins.effects.link_stretch import LinkStretchConfig as LinkStretchConfig
    from pliant_plugins.effects.load_error import LoadErrorConfig as LoadErrorConfig
    from pliant_plugins.effects.mullins import MullinsConfig as MullinsConfig
    from pliant_plugins.effects.payload_error import PayloadErrorConfig as PayloadErrorConfig
    from pliant_plugins.effects.permanent_set import PermanentSetConfig as PermanentSetConfig
    from pliant_plugins.effects.pressure_offset import PressureOffsetConfig as PressureOffsetConfig
    from pliant_plugins.effects.self_contact import SelfContactConfig as SelfContactConfig
    from pliant_plugins.effects.sensor_bias import SensorBiasConfig as SensorBiasConfig
    from pliant_plugins.effects.sensor_lag import SensorLagConfig as SensorLagConfig
    from pliant_plugins.effects.sensor_scale import SensorScaleConfig as SensorScaleConfig
    from pliant_plugins.effects.stiffness import StiffnessConfig as StiffnessConfig
    from pliant_plugins.effects.supply_lag import SupplyLagConfig as SupplyLagConfig
    from pliant_plugins.effects.tendon_friction import TendonFrictionConfig as TendonFrictionConfig
    from pliant_plugins.effects.tendon_slack import TendonSlackConfig as TendonSlackConfig
    from pliant_plugins.effects.thermal_softening import ThermalSofteningConfig as ThermalSofteningConfig
    from pliant_plugins.effects.unequal_actuators import UnequalActuatorsConfig as UnequalActuatorsConfig
    from pliant_plugins.effects.viscoelastic import ViscoelasticConfig as ViscoelasticConfig
    from pliant_plugins.effects.viscous_damping import ViscousDampingConfig as ViscousDampingConfig
    from pliant_plugins.effects.wall_thickness import WallThicknessConfig as WallThicknessConfig
    from pliant_plugins.families.bellow_bending.family import BellowBendingConfig as BellowBendingConfig
    from pliant_plugins.families.bellow_helical.family import BellowHelicalConfig as BellowHelicalConfig
    from pliant_plugins.families.bellow_translational.family import (
        BellowTranslationalConfig as BellowTranslationalConfig,
    )
    from pliant_plugins.families.chambers.three_chamber import ThreeChamberConfig as ThreeChamberConfig
    from pliant_plugins.families.chambers.two_chamber import TwoChamberConfig as TwoChamberConfig
    from pliant_plugins.families.fibre_reinforced.family import FibreReinforcedConfig as FibreReinforcedConfig
    from pliant_plugins.families.mesh_file.family import MeshFileConfig as MeshFileConfig
    from pliant_plugins.families.pneunet.family import PneunetConfig as PneunetConfig
    from pliant_plugins.families.tendon_joint.family import TendonJointConfig as TendonJointConfig
    from pliant_plugins.fem.config import NgsolveConfig as NgsolveConfig
    from pliant_plugins.fem.config import SkfemConfig as SkfemConfig
    from pliant_plugins.materials.mooney_rivlin import MooneyRivlinConfig as MooneyRivlinConfig
    from pliant_plugins.materials.named import NamedConfig as NamedConfig
    from pliant_plugins.materials.neo_hookean import NeoHookeanConfig as NeoHookeanConfig
    from pliant_plugins.materials.ogden import OgdenConfig as OgdenConfig
    from pliant_plugins.materials.yeoh import YeohConfig as YeohConfig
    from pliant_plugins.physics.mujoco.config import MujocoConfig as MujocoConfig
    from pliant_plugins.physics.pybullet.config import PybulletConfig as PybulletConfig
    from pliant_plugins.physics.quasistatic.config import QuasistaticConfig as QuasistaticConfig
    from pliant_plugins.surrogates.config import NeuralConfig as NeuralConfig
    from pliant_plugins.surrogates.config import PolynomialConfig as PolynomialConfig
    from pliant_plugins.surrogates.config import TableConfig as TableConfig
    from pliant_plugins.tasks.crawl.config import CrawlConfig as CrawlConfig
    from pliant_plugins.tasks.follow_pressure import FollowPressureConfig as FollowPressureConfig
    from pliant_plugins.tasks.follow_shape import FollowShapeConfig as FollowShapeConfig
    from pliant_plugins.tasks.grasp.config import GraspConfig as GraspConfig
    from pliant_plugins.tasks.helical_hang import HelicalHangConfig as HelicalHangConfig
    from pliant_plugins.tasks.hold_and_turn.config import HoldAndTurnConfig as HoldAndTurnConfig
    from pliant_plugins.tasks.push.config import PushConfig as PushConfig
    from pliant_plugins.tasks.ramp import FreeBendingConfig as FreeBendingConfig
    from pliant_plugins.tasks.ramp import TipLoadConfig as TipLoadConfig
    from pliant_plugins.tasks.reach import ReachConfig as ReachConfig
    from pliant_plugins.tasks.reach_around.config import ReachAroundConfig as ReachAroundConfig
    from pliant_plugins.tasks.tendon_finger import TendonFingerConfig as TendonFingerConfig


def _places() -> dict[str, str]:
    """Return the module of each config class by its name."""
    from pliant_plugins.manifest import pliant_components

    places = (component.config.partition(":") for component in pliant_components())
    return {name: module for module, _, name in places}


def __getattr__(name: str) -> Any:
    if name.startswith("_") or name not in (places := _places()):
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    return getattr(import_module(places[name]), name)


def __dir__() -> list[str]:
    return sorted(_places())
