"""The core's own manifest: verbs, blocks of a study, stored records and interfaces; nothing else is imported."""

from __future__ import annotations

from collections.abc import Iterable

from pliant.registry.block import Block
from pliant.registry.command import Command
from pliant.registry.hookspecs import hookimpl
from pliant.registry.interface import Interface
from pliant.registry.stored_record import StoredRecord

# Verb → module of `pliant.cli` with a function of its name, in the order of `pliant --help`.
MODULES = {
    "example": "example",
    "run": "studies",
    "fem": "studies",
    "fit": "fit",
    "simulate": "studies",
    "doctor": "doctor",
    "report": "studies",
    "plugins": "plugins",
    "check": "plugins",
    "schema": "plugins",
    "new-plugin": "plugins",
    "compare": "evidence",
    "diagnose": "evidence",
    "plan": "plan",
    "extend": "extend",
    "improve": "improve",
    "import": "importing",
    "store": "store",
}
# Verbs whose name is a Python keyword.
FUNCTIONS = {"import": "import_"}
# Modules of `pliant.records` → the records in them that the store may hold.
RECORDS = {
    "design": ("Design",),
    "fem": ("FemDataset", "FemState", "ModuleData", "ModuleShape"),
    "law": ("FitReport", "LawRecord"),
    "load_frames": ("LoadFrames",),
    "mount": ("Carrier",),
    "rollout": ("Equilibrium", "OutsideDomain", "Rollout", "TaskResult"),
    "scene": ("SceneFrames", "SceneStill"),
    "shape": ("Shape", "TriangleMesh"),
}
# Interface → its base classes, and the further modules of `pliant.testing` with its checks.
INTERFACES = {
    "family": (("ActuatorFamily",), ()),
    "material": (("Material",), ()),
    "fem": (("FEMBackend",), ()),
    "surrogate": (("Surrogate",), ()),
    "effect": (("Effect",), ("effect_terms", "effect_found")),
    "physics": (("PhysicsBackend",), ("physics_runs", "physics_motion", "physics_scene")),
    "task": (("Task", "SceneTask"), ()),
    "viewer": (("Viewer",), ()),
    "model": (("SystemModel",), ()),
}


@hookimpl
def pliant_commands() -> Iterable[Command]:
    """Return the verbs of `pliant.cli`."""
    return [
        Command(verb, f"pliant.cli.{module}:{FUNCTIONS.get(verb, verb.replace('-', '_'))}")
        for verb, module in MODULES.items()
    ]


@hookimpl
def pliant_blocks() -> Iterable[Block]:
    """Return the blocks that `pliant.config.study.Study` types, in its order."""
    return [
        Block("model", interface="model", paths=("file",), fixed="a search designs chains of modules"),
        Block("family", interface="family", paths=("visual", "file")),
        Block("material", interface="material"),
        Block("fem", interface="fem"),
        Block("surrogate", interface="surrogate", paths=("data",)),
        Block("chain", "pliant.config.chain:ChainConfig", paths=("file",)),
        Block("physics", interface="physics"),
        Block("cross_check", interface="physics", many=True),
        Block("task", interface="task", paths=("mesh", "points", "path", "backbone", "file")),
        Block("effects", interface="effect", many=True),
        Block("posterior", "pliant.config.posterior:PosteriorConfig", fixed="it is the uncertainty of a fit"),
        Block(
            "measurements",
            "pliant.config.measurements:MeasurementsConfig",
            paths=("file",),
            fixed="they are what the bench recorded",
        ),
        Block("uncertainty", "pliant.config.noise:UncertaintyConfig"),
        Block("noise", "pliant.config.noise:NoiseConfig"),
        Block(
            "protocols", "pliant.config.protocols:ProtocolConfig", many=True, fixed="they are for the bench"
        ),
        Block("workers", "pliant.config.study:WorkersConfig"),
    ]


@hookimpl
def pliant_records() -> Iterable[StoredRecord]:
    """Return the records of `pliant.records` that the store may hold."""
    return [
        StoredRecord(f"pliant.records.{module}:{name}") for module, names in RECORDS.items() for name in names
    ]


@hookimpl
def pliant_interfaces() -> Iterable[Interface]:
    """Return the interfaces of `pliant.interfaces`; the checks of each are in `pliant.testing`."""
    return [
        Interface(
            name,
            f"pliant.interfaces.{name}:{name.title().replace('_', '')}Config",
            tuple(f"pliant.interfaces.{name}:{base}" for base in bases),
            tuple(f"pliant.testing.{module}" for module in (name, *checks)),
        )
        for name, (bases, checks) in INTERFACES.items()
    ]
