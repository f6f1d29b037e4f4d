"""The typed study. Plugin blocks get the config model of their `kind` when the study is read."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any, Literal, get_args

from pydantic import Field, PrivateAttr, create_model, model_validator

from pliant.config.chain import ChainConfig, SegmentConfig
from pliant.config.measurements import MeasurementsConfig
from pliant.config.noise import NoiseConfig, UncertaintyConfig
from pliant.config.places import Places
from pliant.config.posterior import PosteriorConfig
from pliant.config.protocols import ProtocolConfig
from pliant.errors import UserError
from pliant.interfaces.base import ComponentConfig, FrozenModel
from pliant.interfaces.effect import EffectConfig
from pliant.interfaces.family import FamilyConfig
from pliant.interfaces.fem import FemConfig
from pliant.interfaces.material import MaterialConfig
from pliant.interfaces.model import ModelConfig
from pliant.interfaces.physics import PhysicsConfig
from pliant.interfaces.surrogate import SurrogateConfig
from pliant.interfaces.task import TaskConfig
from pliant.registry.block import Block, blocks, kind_blocks, kind_lists
from pliant.registry.discovery import CHAIN, Registry
from pliant.registry.files import with_files
from pliant.registry.interface import interfaces
from pliant.registry.place import imported
from pliant.units import Ratio, strip_unit_suffix


class WorkersConfig(FrozenModel):
    """`workers: 2` for processes of this machine, `workers: {kind: dask, address: tcp://host:8786}` for a cluster.

    FEM sweeps, searches with their checks, diagnoses and counted trials use them. Results do not depend on the workers,
    and no key of stored data, laws or searches includes them.
    """

    kind: Literal["processes", "dask"] = Field(
        "processes", description="of this machine, or those of a dask cluster"
    )
    count: int | None = Field(None, ge=1, description="processes; one for each CPU by default")
    address: str | None = Field(
        None, min_length=1, description="of the dask scheduler, tcp://host:8786, or its file"
    )

    @model_validator(mode="before")
    @classmethod
    def _number(cls, raw: Any) -> Any:
        return {"count": raw} if isinstance(raw, int) and not isinstance(raw, bool) else raw

    @model_validator(mode="after")
    def _check_exclusive_keys(self) -> WorkersConfig:
        if self.kind == "dask" and self.address is None:
            raise ValueError("dask needs the 'address' of its scheduler, tcp://host:8786, or its file")
        if self.kind == "dask" and self.count is not None:
            raise ValueError("a dask cluster has as many workers as it has; leave 'count' out")
        if self.kind == "processes" and self.address is not None:
            raise ValueError("'address' is of a dask scheduler; write kind: dask")
        return self

    @property
    def who(self) -> int | str | None:
        """Return a number of processes, or a scheduler's address or file; None: a process for each CPU."""
        return self.address if self.kind == "dask" else self.count


# Blocks of a chain of modules, which a study with a `model` of its own does not have.
OF_CHAINS = ("family", "material", "fem", "surrogate", "law_error", "chain", "physics", "cross_check", "task")
NAME_PATTERN = r"^[A-Za-z0-9][A-Za-z0-9._-]*$"


class Study(FrozenModel):
    """The contents of a study file. `cross_check` lists further engines that run the same task for comparison."""

    _places: Places = PrivateAttr(default_factory=Places)

    pliant: Literal[1] = Field(1, description="format version")
    plugins: tuple[Path, ...] = Field(
        (), description="Python files with effects of your own (docs/write_an_effect.md)"
    )
    name: str = Field(pattern=NAME_PATTERN, max_length=100, description="names the output folder")
    model: ModelConfig | None = Field(
        None, description="a model of your own instead of a chain of modules (docs/your_own_model.md)"
    )
    family: FamilyConfig | None = Field(None, description="the actuator module and its design parameters")
    material: MaterialConfig | None = Field(None, description="what it is made of")
    fem: FemConfig | None = Field(None, description="which states are solved, and by what")
    surrogate: SurrogateConfig | None = Field(
        None, description="how data become a law; polynomial by default"
    )
    law_error: Ratio | None = Field(
        None,
        gt=0,
        le=0.5,
        description="how far the joint laws may be off from the real module, as a share of their torque range: "
        "'1 %'; without it a diagnosis assumes 0.3 to 3 %",
    )
    chain: ChainConfig | None = Field(None, description="how modules become a robot")
    physics: PhysicsConfig | None = Field(None, description="the engine; quasistatic by default")
    cross_check: tuple[PhysicsConfig, ...] = Field(
        (), description="engines that run the same task, for comparison"
    )
    task: TaskConfig | None = Field(None, description="what the robot does")
    effects: tuple[EffectConfig, ...] = Field((), description="physical effects, applied in this order")
    posterior: PosteriorConfig | None = Field(
        None,
        description="uncertainty of the effects' parameters, written by fits (docs/extend_and_improve.md)",
    )
    measurements: MeasurementsConfig | None = Field(
        None, description="what the bench recorded (docs/measurement_files.md)"
    )
    uncertainty: UncertaintyConfig | None = Field(
        None, description="carries the error bars of the laws to the tip"
    )
    noise: NoiseConfig | None = Field(
        None, description="how far the task's conditions vary from trial to trial"
    )
    protocols: tuple[ProtocolConfig, ...] = Field(
        (),
        description="runs that the bench can do, instead of the default menu (docs/plan_the_next_experiment.md)",
    )
    workers: WorkersConfig | None = Field(
        None,
        description="who works: a number of processes, or a dask cluster (docs/run_a_sweep_on_a_cluster.md)",
    )

    @model_validator(mode="after")
    def _check_one_model(self) -> Study:
        chained = [key for key in OF_CHAINS if getattr(self, key)]
        if self.model is not None and chained:
            raise ValueError(f"'model' stands for the whole robot; leave out {', '.join(chained)}")
        return self

    @property
    def places(self) -> Places:
        """Return where each key was written; empty for a study that came from no file."""
        return self._places

    @property
    def model_kind(self) -> str:
        """Return the kind of the study's model: that of its block `model`, or `chain`."""
        return CHAIN if self.model is None else self.model.kind

    def registry(self, installed: Registry) -> Registry:
        """Return the registry with the study's own plugin files, and the effects of its kind of model."""
        found = with_files(installed, self.plugins)
        words = None if self.model is None else partial(_words, found, self.model)
        return found.for_model(self.model_kind, words=words)

    def stand_at(self, places: Places) -> None:
        """Keep the places where the keys were written, for messages; its measurements keep their own."""
        self._places = places
        if self.measurements is not None:
            self.measurements.stand_at(places.below("measurements"))

    def block(self, key: str) -> Any:
        """Return the value of a block, of Pliant or of another package; None where the study has none."""
        return getattr(self, key, None)

    def canonical(self) -> dict[str, Any]:
        """Return the study as JSON values under SI names; absent blocks of other packages are left out."""
        values = super().canonical()
        return {k: value for k, value in values.items() if value is not None or k in Study.model_fields}

    def need(self, key: str, what: str) -> Any:
        """Return the block `key`; raises `UserError` that names the command that needs it."""
        block = self.block(key)
        if block is None and key in OF_CHAINS:
            self.check_is_chain(what)
        if block is None:
            raise UserError(f"study '{self.name}' has no '{key}' block; {what} needs one.")
        return block

    def check_is_chain(self, what: str) -> None:
        """Raise `UserError` if the study has a model of its own, for work that needs a chain of modules."""
        if self.model is not None:
            raise UserError(
                f"study '{self.name}' has a model of its own, and {what} needs a chain of modules; 'compare', "
                "'diagnose', 'plan', 'extend', 'improve' and 'export' take it."
            )

    def resolve_workers(self, asked: Any, otherwise: int | None = None) -> Any:
        """Return the requested workers, else those of `workers`, else `otherwise`; None: a process for each CPU."""
        if asked is not None:
            return asked
        return otherwise if self.workers is None else self.workers.who

    def unused(self) -> list[str]:
        """Return keys that are set but that no stage of a run reads, without `read_by`."""
        keys: list[str] = []
        for block in blocks().values():
            if block.unused and self.block(block.key) is not None:
                keys += imported(block.unused)(self)
        if self.noise is not None and self.task is not None and not self._task_has_noise():
            keys.append("noise")
        return keys

    def read_by(self) -> dict[str, list[str]]:
        """Return the keys that are set and that only one verb reads, by this verb."""
        keys: dict[str, list[str]] = {}
        for block in blocks().values():
            if block.reader and self.block(block.key) is not None:
                keys.setdefault(block.reader, []).append(block.key)
        return keys

    def noisy_task(self) -> TaskConfig:
        """Return the task's config with the study's noise, if the task has noise.

        Raises:
            UserError: no task, or noise in both places.
        """
        task: TaskConfig = self.need("task", "a simulation")
        if self.noise is None or not self._task_has_noise():
            return task
        # Canonical JSON, from which workers read a study, also states the task's own default.
        default = type(task).model_fields["noise"].get_default(call_default_factory=True)
        stated: Any = task
        if stated.noise != default:
            raise UserError(f"study '{self.name}' has 'noise' at its top and in its task; give it once.")
        return task.model_copy(update={"noise": self.noise})

    def _task_has_noise(self) -> bool:
        return self.task is not None and "noise" in type(self.task).model_fields


def _words(registry: Registry, model: ModelConfig, kind: str) -> str:
    """Return a model's own words on an effect at one of its places."""
    return str(registry.get("model", model.kind).build(model).words(kind))


def study_model(raw: Mapping[str, Any], registry: Registry) -> type[Study]:
    """Return `Study` with each plugin block typed by the config model of its kind, and the blocks of other packages.

    Raises `UserError` for an unknown kind. Blocks that are not mappings with a `kind` keep the base type, so
    that pydantic reports them.
    """
    fields: dict[str, Any] = {}
    registry = registry.for_model(_block_kind(raw.get("model")) or CHAIN)
    for key, block in blocks().items():
        if typed := _typed(block, raw.get(key), registry):
            fields[key] = (typed, ...)
        elif key not in Study.model_fields:
            fields[key] = optional_field(block)
    segments = _segment_models(raw.get("chain"), registry)
    if segments:
        chain = create_model(
            "ChainConfig",
            __base__=ChainConfig,
            segments=(tuple[segments], ...),  # type: ignore[valid-type]
        )
        fields["chain"] = (chain, ...)
    return create_model("Study", __base__=Study, **fields)


def optional_field(block: Block) -> tuple[Any, Any]:
    """Return type and default of a block of another package, for `create_model`."""
    model: Any = interfaces()[block.interface].config_class() if block.interface else block.model_class()
    if block.many:
        return tuple[model, ...], Field((), description=block.description)
    return model | None, Field(None, description=block.description)


def _typed(block: Block, value: Any, registry: Registry) -> Any:
    """Return the type of a block with an interface by the kinds in its value; None without them."""
    if not block.interface:
        return None
    if not block.many:
        return registry.config_model(block.interface, value) if _block_kind(value) is not None else None
    if not (isinstance(value, list) and value and all(_block_kind(item) for item in value)):
        return None
    models = tuple(registry.get(block.interface, _block_kind(item) or "").config_model() for item in value)
    return tuple[models]  # type: ignore[valid-type]


def _segment_models(chain: Any, registry: Registry) -> tuple[type[SegmentConfig], ...]:
    """Return a model for each segment, its own law typed by its kind; empty if no segment has its own law."""
    segments = chain.get("segments") if isinstance(chain, Mapping) else None
    models: list[type[SegmentConfig]] = []
    for segment in segments if isinstance(segments, list) else ():
        kind = _block_kind(segment.get("surrogate")) if isinstance(segment, Mapping) else None
        if kind is None:
            models.append(SegmentConfig)
        else:
            law = registry.get("surrogate", kind).config_model()
            models.append(create_model("SegmentConfig", __base__=SegmentConfig, surrogate=(law, ...)))
    return tuple(models) if any(model is not SegmentConfig for model in models) else ()


def _block_kind(block: Any) -> str | None:
    kind = block.get("kind") if isinstance(block, Mapping) else None
    return kind if isinstance(kind, str) else None


def normalised(raw: Mapping[str, Any]) -> dict[str, Any]:
    """Return the study with ``physics: mujoco`` written out as ``physics: {kind: mujoco}``."""
    study = dict(raw)
    for key in kind_blocks():
        if isinstance(study.get(key), str):
            study[key] = {"kind": study[key]}
    for key in kind_lists():
        if key in study and study[key] is None:  # an empty list, as an empty block means no block
            study[key] = []
        if isinstance(study.get(key), list):
            study[key] = [{"kind": b} if isinstance(b, str) else b for b in study[key]]
    if isinstance(study.get("workers"), str):
        study["workers"] = {"kind": study["workers"]}
    return study


def varied(config: ComponentConfig, changes: Mapping[str, Any]) -> ComponentConfig:
    """Return the config with some keys changed and validated again; keys may have their unit or not."""
    values = {strip_unit_suffix(key): value for key, value in config.model_dump(mode="json").items()}
    values.update({strip_unit_suffix(key): value for key, value in changes.items()})
    return type(config).model_validate(values)


def allowed_keys(model: type[FrozenModel]) -> list[str]:
    """Return the keys as people write them."""
    return [written_name(model, name) for name in model.model_fields]


def written_name(model: type[FrozenModel], field: str) -> str:
    """Return how a study writes a field: `wall_m` as `wall`, but `k_n` as `k_n` where a model keeps its names."""
    alias = model.model_fields[field].validation_alias
    return alias if isinstance(alias, str) else field


def nested_model(annotation: Any) -> type[FrozenModel] | None:
    """Return the model inside an annotation such as `X | None` or `tuple[X, ...]`, or None."""
    if isinstance(annotation, type) and issubclass(annotation, FrozenModel):
        return annotation
    for argument in get_args(annotation):
        found = nested_model(argument)
        if found is not None:
            return found
    return None
