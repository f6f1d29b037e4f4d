"""The typed study. Plugin blocks get their own config model, found by `kind` when the study is read."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, get_args

from pydantic import ConfigDict, Field, create_model, model_validator

from pliant.config.chain import ChainConfig, SegmentConfig
from pliant.config.measurements import MeasurementsConfig
from pliant.config.noise import NoiseConfig, UncertaintyConfig
from pliant.config.posterior import PosteriorConfig
from pliant.config.protocols import ProtocolConfig
from pliant.config.search import SearchConfig
from pliant.errors import UserError
from pliant.interfaces.base import ComponentConfig, FrozenModel
from pliant.interfaces.effect import EffectConfig
from pliant.interfaces.family import FamilyConfig
from pliant.interfaces.fem import FemConfig
from pliant.interfaces.material import MaterialConfig
from pliant.interfaces.meta_model import MetaModelConfig
from pliant.interfaces.optimizer import OptimizerConfig
from pliant.interfaces.physics import PhysicsConfig
from pliant.interfaces.surrogate import SurrogateConfig
from pliant.interfaces.task import TaskConfig
from pliant.registry.discovery import Registry
from pliant.units import Ratio, strip_unit_suffix

SWEPT_BLOCKS = ("family", "material")
RANGE = {"low", "high", "count"}


class WorkersConfig(FrozenModel):
    """`workers: 2` for processes of this machine, `workers: {kind: dask, address: tcp://host:8786}` for a cluster.

    FEM sweeps, searches with their checks, diagnoses and counted trials are done by them. Results do not depend on
    who works, and no key of stored data, laws or searches holds it.
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
    def _one_of_them(self) -> WorkersConfig:
        if self.kind == "dask" and self.address is None:
            raise ValueError("dask needs the 'address' of its scheduler, tcp://host:8786, or its file")
        if self.kind == "dask" and self.count is not None:
            raise ValueError("a dask cluster has as many workers as it has; leave 'count' out")
        if self.kind == "processes" and self.address is not None:
            raise ValueError("'address' is of a dask scheduler; write kind: dask")
        return self

    @property
    def who(self) -> int | str | None:
        """A number of processes, a scheduler's address or file; None: a process for each CPU."""
        return self.address if self.kind == "dask" else self.count


class SweepConfig(FrozenModel):
    """Parameters of the family, as the family block writes them, each with a list of values or a range
    `{low: 5 mm, high: 7 mm, count: 5}`; every combination is a design. `material.shear_modulus` names a constant
    of the material. `designs: table.csv` gives one design per row instead, the header naming parameters.
    """

    model_config = ConfigDict(extra="allow")

    designs: Path | None = Field(
        None, description="a CSV with one design per row, its header naming parameters"
    )

    @model_validator(mode="before")
    @classmethod
    def _flat(cls, raw: Any) -> Any:
        """`material: {shear_modulus: …}`, as overrides write it, is `material.shear_modulus: …`."""
        if not isinstance(raw, Mapping):
            return raw
        flat: dict[Any, Any] = {}
        for name, value in raw.items():
            if name in SWEPT_BLOCKS and isinstance(value, Mapping) and not RANGE & set(value):
                flat.update({f"{name}.{inner}": item for inner, item in value.items()})
            else:
                flat[name] = value
        return flat

    @property
    def axes(self) -> Mapping[str, Any]:
        """Parameter, as it was written → its values, as they were written."""
        return {name: value for name, value in (self.model_extra or {}).items() if value is not None}


# Study key → interface of the plugin that its `kind` names.
BLOCKS = {
    "family": "family",
    "material": "material",
    "fem": "fem",
    "surrogate": "surrogate",
    "meta_model": "meta_model",
    "physics": "physics",
    "task": "task",
    "optimizer": "optimizer",
}
BLOCK_LISTS = {"effects": "effect", "cross_check": "physics"}
NAME_PATTERN = r"^[A-Za-z0-9][A-Za-z0-9._-]*$"
# Keys that one verb alone reads: `pliant fem` solves a sweep, `pliant optimize` searches.
OF_FEM = ("sweep",)
OF_OPTIMIZE = ("search", "optimizer")


class Study(FrozenModel):
    """What a study file says. `cross_check` lists further engines that run the same task for comparison."""

    pliant: Literal[1] = Field(1, description="format version")
    plugins: tuple[Path, ...] = Field(
        (), description="Python files with effects of your own (docs/write_an_effect.md)"
    )
    name: str = Field(pattern=NAME_PATTERN, max_length=100, description="names the output folder")
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
        None, description="how sure the effects' parameters are; fits write it (docs/extend_and_improve.md)"
    )
    optimizer: OptimizerConfig | None = Field(None, description="proposes designs; cmaes by default")
    measurements: MeasurementsConfig | None = Field(
        None, description="what the bench recorded (docs/measurement_files.md)"
    )
    sweep: SweepConfig | None = Field(None, description="the designs that `pliant fem` solves")
    meta_model: MetaModelConfig | None = Field(
        None, description="one model over the designs of a sweep, which gives the law of any other"
    )
    search: SearchConfig | None = Field(
        None, description="what `pliant optimize` varies and wants (docs/design_for_a_task.md)"
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

    def need(self, key: str, what: str) -> Any:
        """The block `key`, or a `UserError` that says which command needs it."""
        block = getattr(self, key)
        if block is None:
            raise UserError(f"study '{self.name}' has no '{key}' block; {what} needs one.")
        return block

    def who_works(self, asked: Any, otherwise: int | None = None) -> Any:
        """Who was asked to, else whom `workers` names, else `otherwise`; None: a process for each CPU."""
        if asked is not None:
            return asked
        return otherwise if self.workers is None else self.workers.who

    def unused(self) -> list[str]:
        """Keys that are set but that no stage of a run reads; those of a search are no part of one: `searched`."""
        keys = [key for key in OF_FEM if getattr(self, key) is not None]
        if self.meta_model is not None and self.meta_model.data is None:
            keys = [key for key in keys if key != "sweep"]  # its designs are what the meta-model is fitted to
        if self.meta_model is not None and self.surrogate is not None:
            keys.append("surrogate")  # laws come from the meta-model
        if self.noise is not None and self.task is not None and not self._task_has_noise():
            keys.append("noise")
        return keys

    def searched(self) -> list[str]:
        """Keys that are set and that `pliant optimize` alone reads."""
        return [key for key in OF_OPTIMIZE if getattr(self, key) is not None]

    def noisy_task(self) -> TaskConfig:
        """The task's config with the study's noise, where the task knows noise.

        Raises:
            UserError: no task, or noise in both places.
        """
        task: TaskConfig = self.need("task", "a simulation")
        if self.noise is None or not self._task_has_noise():
            return task
        # Canonical JSON, from which workers read a study, states the task's own default too.
        default = type(task).model_fields["noise"].get_default(call_default_factory=True)
        stated: Any = task
        if stated.noise != default:
            raise UserError(f"study '{self.name}' has 'noise' at its top and in its task; give it once.")
        return task.model_copy(update={"noise": self.noise})

    def _task_has_noise(self) -> bool:
        return self.task is not None and "noise" in type(self.task).model_fields


def study_model(raw: Mapping[str, Any], registry: Registry) -> type[Study]:
    """`Study` with each plugin block typed by the config model of its kind.

    Raises `UserError` for an unknown kind. Blocks that are not mappings with a `kind` keep the base type, so
    that pydantic reports them.
    """
    fields: dict[str, Any] = {}
    for key, interface in BLOCKS.items():
        kind = _kind_of(raw.get(key))
        if kind is not None:
            fields[key] = (registry.config_model(interface, raw[key]), ...)
    for key, interface in BLOCK_LISTS.items():
        blocks = raw.get(key)
        if isinstance(blocks, list) and blocks and all(_kind_of(block) for block in blocks):
            models = tuple(registry.get(interface, _kind_of(b) or "").config_model() for b in blocks)
            fields[key] = (tuple[models], ...)  # type: ignore[valid-type]
    segments = _segment_models(raw.get("chain"), registry)
    if segments:
        chain = create_model(
            "ChainConfig",
            __base__=ChainConfig,
            segments=(tuple[segments], ...),  # type: ignore[valid-type]
        )
        fields["chain"] = (chain, ...)
    return create_model("Study", __base__=Study, **fields)


def _segment_models(chain: Any, registry: Registry) -> tuple[type[SegmentConfig], ...]:
    """A model for each segment, its own law typed by its kind; none where no segment has a law of its own."""
    segments = chain.get("segments") if isinstance(chain, Mapping) else None
    models: list[type[SegmentConfig]] = []
    for segment in segments if isinstance(segments, list) else ():
        kind = _kind_of(segment.get("surrogate")) if isinstance(segment, Mapping) else None
        if kind is None:
            models.append(SegmentConfig)
        else:
            law = registry.get("surrogate", kind).config_model()
            models.append(create_model("SegmentConfig", __base__=SegmentConfig, surrogate=(law, ...)))
    return tuple(models) if any(model is not SegmentConfig for model in models) else ()


def _kind_of(block: Any) -> str | None:
    kind = block.get("kind") if isinstance(block, Mapping) else None
    return kind if isinstance(kind, str) else None


def normalised(raw: Mapping[str, Any]) -> dict[str, Any]:
    """The study with ``physics: mujoco`` written out as ``physics: {kind: mujoco}``."""
    study = dict(raw)
    for key in BLOCKS:
        if isinstance(study.get(key), str):
            study[key] = {"kind": study[key]}
    for key in BLOCK_LISTS:
        if key in study and study[key] is None:  # an empty list, as an empty block is no block
            study[key] = []
        if isinstance(study.get(key), list):
            study[key] = [{"kind": b} if isinstance(b, str) else b for b in study[key]]
    if isinstance(study.get("workers"), str):
        study["workers"] = {"kind": study["workers"]}
    return study


def varied(config: ComponentConfig, changes: Mapping[str, Any]) -> ComponentConfig:
    """The config with some keys changed, validated anew; keys may be written with or without their unit."""
    values = {strip_unit_suffix(key): value for key, value in config.model_dump(mode="json").items()}
    values.update({strip_unit_suffix(key): value for key, value in changes.items()})
    return type(config).model_validate(values)


def allowed_keys(model: type[FrozenModel]) -> list[str]:
    """Keys as people write them."""
    return [written_name(model, name) for name in model.model_fields]


def written_name(model: type[FrozenModel], field: str) -> str:
    """How a study writes a field: `wall_m` as `wall`, but `k_n` as `k_n` where a model keeps its names."""
    alias = model.model_fields[field].validation_alias
    return alias if isinstance(alias, str) else field


def nested_model(annotation: Any) -> type[FrozenModel] | None:
    """The model inside an annotation such as `X | None` or `tuple[X, ...]`, or None."""
    if isinstance(annotation, type) and issubclass(annotation, FrozenModel):
        return annotation
    for argument in get_args(annotation):
        found = nested_model(argument)
        if found is not None:
            return found
    return None
