"""Effect: one physical effect that a model may lack."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Literal, Self, get_args

from pydantic import ConfigDict, Field
from pydantic.fields import FieldInfo

from pliant.interfaces.base import ComponentConfig, Configured
from pliant.records.chain import ChainModel
from pliant.records.history import History, held
from pliant.records.term import LawTerm
from pliant.units import Quantity

# Of a chain: input, law, chain, output. Of a user's own model: input, output, and its attachment points.
Place = Literal["input", "law", "chain", "output", "joint", "tendon", "body", "world", "state", "parameter"]
# Separates the kind of an effect from the names of the places where it acts: `viscous_damping@elbow`.
AT = "@"
# Readings by name: numbers, lists of them or arrays over time.
Readings = Mapping[str, Any]
InputMap = Callable[[History], History]
OutputMap = Callable[[Readings], Readings]


Role = Literal["strength", "shape", "form"]
Prior = Literal["normal", "log_normal"]
# What has to be corrected: the model, or the laboratory record.
Origin = Literal["physics", "bench"]


@dataclass(frozen=True)
class EffectParameter:
    """A number that calibration may fit, declared as a field of an effect's config by `parameter`.

    Attributes:
        name: the config's field.
        unit: its SI unit; "1" for a pure number.
        neutral: the value at which the effect vanishes; for a `shape`, any typical value; for a `form`, the basic form.
        bounds: hard limits.
        plausible: the range that an expert expects: the central 90 % of the prior.
        role: `strength` scales the effect, which vanishes at `neutral`; `shape` determines when or how it acts; `form`
            varies its equation (an exponent, a second time constant): fixed at `neutral`, the basic form, until a
            diagnosis tests whether a variant of a leading effect fits better.
        prior: `normal`, or `log_normal` for numbers of unknown order of magnitude (times, widths).
        simpler: for a `shape`, values at which a simpler form is enough, each with its meaning in words:
            ``(0.01, "one volume is enough")``. A fit that ends there is no problem.
    """

    name: str
    unit: str
    neutral: float
    bounds: tuple[float, float]
    plausible: tuple[float, float]
    role: Role = "strength"
    prior: Prior = "normal"
    simpler: tuple[tuple[float, str], ...] = ()

    def problem(self) -> str | None:
        """Return the error in the declaration, or None."""
        (low, high), (least, most) = self.bounds, self.plausible
        if not low < high:
            return f"bounds {self.bounds} are not ordered"
        if not low <= self.neutral <= high:
            return f"neutral {self.neutral:g} is outside the bounds {self.bounds}"
        if not low <= least < most <= high:
            return f"plausible {self.plausible} is not an ordered range within the bounds {self.bounds}"
        for what, value, known in (("role", self.role, Role), ("prior", self.prior, Prior)):
            if value not in get_args(known):
                return f"{what} '{value}' is not one of {', '.join(get_args(known))}"
        if self.prior == "log_normal" and least <= 0:
            return f"a log-normal prior has no room for {least:g}"
        if self.simpler and self.role != "shape":
            return "only a shape has simpler forms: elsewhere the neutral value is the simplest"
        for at, words in self.simpler:
            if not (low <= at <= high and words):
                return f"simpler form {at:g} '{words}' is outside the bounds {self.bounds} or has no words"
        return None


def parameter(
    *,
    neutral: float,
    bounds: tuple[float, float],
    plausible: tuple[float, float],
    unit: str = "",
    role: Role = "strength",
    prior: Prior = "normal",
    simpler: Mapping[float, str] | None = None,
    description: str = "",
    example: Any = None,
) -> Any:
    """Declare a field of an `EffectConfig` that calibration may fit, an `EffectParameter`.

    The field's default is `neutral`, its hard limits are `bounds`, both ends included. A field of a quantity
    (`play_rad: Angle`) has that quantity's unit; a plain float states its `unit`. `simpler` maps values of a shape at
    which a simpler form is enough to sentences: ``{0.01: "one volume is enough"}``; `example`, in a study's notation,
    is used in the component's smallest block. `EffectConfig.fit_parameters` raises `TypeError` for an invalid
    declaration.
    """
    info: FieldInfo = Field(  # type: ignore[assignment]
        default=neutral,
        ge=bounds[0],
        le=bounds[1],
        description=description or None,
        examples=None if example is None else [example],
    )
    forms = tuple((simpler or {}).items())
    info.metadata.append(EffectParameter("", unit, neutral, bounds, plausible, role, prior, forms))
    return info


class EffectConfig(ComponentConfig):
    """Base of an effect's config: a field for each number of the effect, by `parameter` if it may be fitted.

    The string below a field describes it.
    """

    model_config = ConfigDict(use_attribute_docstrings=True)

    @classmethod
    def __pydantic_init_subclass__(cls, **kwargs: Any) -> None:
        """Reject an invalid declaration when the class is defined."""
        super().__pydantic_init_subclass__(**kwargs)
        cls.fit_parameters()

    @classmethod
    def fit_parameters(cls) -> tuple[EffectParameter, ...]:
        """Return the strengths and shapes that calibration may fit, in the order of their fields.

        Raises:
            TypeError: an invalid declaration, such as a plausible range outside the bounds.
        """
        return tuple(one for one in cls._declared() if one.role != "form")

    @classmethod
    def form_parameters(cls) -> tuple[EffectParameter, ...]:
        """Return the numbers that vary the form of the effect's equation; same errors as `fit_parameters`."""
        return tuple(one for one in cls._declared() if one.role == "form")

    @classmethod
    def _declared(cls) -> tuple[EffectParameter, ...]:
        declared = []
        for name, info in cls.model_fields.items():
            for item in info.metadata:
                if isinstance(item, EffectParameter):
                    declared.append(replace(item, name=name, unit=_unit(cls, name, item.unit)))
        for one in declared:
            if (problem := one.problem()) is not None:
                raise TypeError(f"{cls.__name__}.{one.name}: {problem}")
        return tuple(declared)


def _unit(model: type[EffectConfig], name: str, stated: str) -> str:
    """Return the unit of a field's quantity, or the stated one of a plain number; raise `TypeError` if they differ."""
    quantity = next((m.unit for m in model.model_fields[name].metadata if isinstance(m, Quantity)), "")
    quantity = "1" if quantity == "dimensionless" else quantity
    if not (stated or quantity):
        raise TypeError(f"{model.__name__}.{name}: it has no unit; write unit=…, or a type such as Angle")
    if stated and quantity and stated != quantity:
        raise TypeError(f"{model.__name__}.{name}: unit '{stated}' is not that of its type, '{quantity}'")
    return stated or quantity


@dataclass(frozen=True)
class EffectNotes:
    """An effect in words, for the catalogue and the output of `pliant diagnose`; its manifest's summary names it.

    Attributes:
        signature: its signature in the data.
        inspection: inspection in the laboratory, one imperative sentence.
        confounder: the kind of effect that is most easily confused with it.
        distinguishing_test: the difference between the two.
        excitation: the run that excites it, as an imperative sentence.
        where: the families and chains to which it applies, and the engines that support it.
        origin: `physics`, or `bench` for an error of the record (a payload, a clock), which is corrected in the file
            instead of extending the model.
    """

    signature: str = ""
    inspection: str = ""
    confounder: str = ""
    distinguishing_test: str = ""
    excitation: str = ""
    where: str = ""
    origin: Origin = "physics"


@dataclass(frozen=True, eq=False)
class SignalMaps:
    """Maps of the inputs and of the readings of a model, which effects change.

    An input map takes the history of one run and returns the history that reaches the system. An output map
    takes readings by name (docs/conventions.md) and returns the sensor values; it leaves other names unchanged. The
    readings of a run with a clock include `time_s` (t,); if the inputs that reach a chain are known, they include
    `actuation` (t,), their unsigned sum.
    """

    inputs: tuple[InputMap, ...] = field(default=(), kw_only=True)
    outputs: tuple[OutputMap, ...] = field(default=(), kw_only=True)

    def with_(self, **changes: object) -> Self:
        """Return a copy with some fields replaced."""
        return replace(self, **changes)  # type: ignore[arg-type]

    def with_input(self, change: InputMap) -> Self:
        """Return a copy with an additional map of its inputs."""
        return replace(self, inputs=(*self.inputs, change))

    def with_output(self, change: OutputMap) -> Self:
        """Return a copy with an additional map of its readings."""
        return replace(self, outputs=(*self.outputs, change))

    def commanded(self, history: History) -> History:
        """Return the history that reaches the system for a commanded one: closed valves, then the effects' maps."""
        history = held(history)
        for change in self.inputs:
            history = change(history)
        return history

    def reported(self, readings: Readings) -> Readings:
        """Return the sensor values for these readings."""
        for change in self.outputs:
            readings = change(readings)
        return readings


@dataclass(frozen=True, eq=False)
class Model(SignalMaps):
    """A chain with its law terms, maps of its inputs and maps of its readings, which effects change."""

    chain: ChainModel

    def with_term(self, term: LawTerm) -> Model:
        """Return a copy with an additional term in every joint's law."""
        return replace(self, chain=self.chain.with_(terms=(*self.chain.terms, term)))


class Effect(Configured[EffectConfig]):
    """One effect at one of four places: input, joint law, chain, output.

    The simulate stage applies a study's `effects` in their order; an effect never changes a model in place and
    keeps no memory: internal states belong to `LawTerm`s, and an input map gets the whole run. The docstring
    of a subclass's file gives the equation and its source. `recommended_experiments` names runs of the default
    catalogue (`pliant.experiments.experiment_catalogue`) that excite the effect and distinguish it from its look-alike.
    `models` are the kinds of models that an effect of a user's file changes, a package states them in its manifest.
    `actuation` names the input that the chain's laws must have for the effect to apply (`tendon_force_n`); "" for any
    input. `fitted` is False if an effect's numbers are learned as a whole: it then declares no parameter, so that no
    diagnosis tries it.
    """

    place: ClassVar[Place]
    models: ClassVar[tuple[str, ...]] = ("chain",)
    notes: ClassVar[EffectNotes] = EffectNotes()
    recommended_experiments: ClassVar[tuple[str, ...]] = ()
    actuation: ClassVar[str] = ""
    fitted: ClassVar[bool] = True

    def unsuited(self, chain: ChainModel, histories: Sequence[History]) -> str:
        """Return why recordings like these cannot show the effect, whatever its strength; "" if they can.

        A diagnosis omits effects that give a reason, so that they do not add to the complexity penalty of the others.
        """
        return ""

    @abstractmethod
    def apply(self, model: Model) -> Model:
        """Return the model with this effect, at the parameter values of the config."""
