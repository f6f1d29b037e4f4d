"""Effect: one physical effect that a model may lack."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal, get_args

from pydantic import ConfigDict, Field
from pydantic.fields import FieldInfo

from pliant.interfaces.base import ComponentConfig, Configured
from pliant.records.chain import ChainModel
from pliant.records.history import History, held
from pliant.records.term import LawTerm
from pliant.units import Quantity

Place = Literal["input", "law", "chain", "output"]
# Readings by name: numbers, lists of them or arrays over time.
Readings = Mapping[str, Any]
InputMap = Callable[[History], History]
OutputMap = Callable[[Readings], Readings]


Role = Literal["strength", "shape", "form"]
Prior = Literal["normal", "log_normal"]
# What has to be mended: the model, or the record that the bench made.
Origin = Literal["physics", "bench"]


@dataclass(frozen=True)
class EffectParameter:
    """A number that calibration may fit, as a field of an effect's config declares it by `parameter`.

    Attributes:
        name: the config's field.
        unit: its SI unit; "1" for a pure number.
        neutral: the value at which the effect vanishes; for a `shape`, any typical value; for a `form`, the plain one.
        bounds: hard limits.
        plausible: the range that would not surprise an expert: the central 90 % of the prior.
        role: `strength` scales the effect and makes it vanish at `neutral`; `shape` says when or how it acts; `form`
            bends its equation into a relative of it (an exponent, a second time constant): held at `neutral`, the plain
            form, until a diagnosis asks whether a relative of a leading effect fits better.
        prior: `normal`, or `log_normal` for numbers whose order of magnitude is open (times, widths).
        simpler: for a `shape`, values at which a simpler form is enough, each with what that means in the effect's
            own words: ``(0.01, "one volume is enough")``. A fit that ends there is no cause for alarm.
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
        """What is wrong with the declaration, or None."""
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
    """A field of an `EffectConfig` that calibration may fit: the one declaration of an `EffectParameter`.

    The field's default is `neutral`, its hard limits are `bounds`, both ends included. A field of a quantity
    (`play_rad: Angle`) has that quantity's unit; a plain float states its `unit`. `simpler` says of a shape at which
    values a simpler form is enough, and how: ``{0.01: "one volume is enough"}``; `example`, as people write it, goes
    into the component's smallest block. `EffectConfig.fit_parameters` raises `TypeError` for a declaration that cannot
    be.
    """
    field: FieldInfo = Field(  # type: ignore[assignment]
        default=neutral,
        ge=bounds[0],
        le=bounds[1],
        description=description or None,
        examples=None if example is None else [example],
    )
    forms = tuple((simpler or {}).items())
    field.metadata.append(EffectParameter("", unit, neutral, bounds, plausible, role, prior, forms))
    return field


class EffectConfig(ComponentConfig):
    """Base of an effect's config: a field for each number of the effect, by `parameter` where it may be fitted.

    The string below a field describes it.
    """

    model_config = ConfigDict(use_attribute_docstrings=True)

    @classmethod
    def __pydantic_init_subclass__(cls, **kwargs: Any) -> None:
        """Refuse a wrong declaration where it is written."""
        super().__pydantic_init_subclass__(**kwargs)
        cls.fit_parameters()

    @classmethod
    def fit_parameters(cls) -> tuple[EffectParameter, ...]:
        """The strengths and shapes that calibration may fit, in the order of their fields.

        Raises:
            TypeError: a declaration that cannot be, such as a plausible range outside the bounds.
        """
        return tuple(one for one in cls._declared() if one.role != "form")

    @classmethod
    def form_parameters(cls) -> tuple[EffectParameter, ...]:
        """The numbers that bend the effect's equation into its relatives; same errors as `fit_parameters`."""
        return tuple(one for one in cls._declared() if one.role == "form")

    @classmethod
    def _declared(cls) -> tuple[EffectParameter, ...]:
        declared = []
        for name, field in cls.model_fields.items():
            for item in field.metadata:
                if isinstance(item, EffectParameter):
                    declared.append(replace(item, name=name, unit=_unit(cls, name, item.unit)))
        for one in declared:
            if (problem := one.problem()) is not None:
                raise TypeError(f"{cls.__name__}.{one.name}: {problem}")
        return tuple(declared)


def _unit(model: type[EffectConfig], name: str, stated: str) -> str:
    """The unit of a field's quantity, or the stated one of a plain number; raises `TypeError` where they part."""
    quantity = next((m.unit for m in model.model_fields[name].metadata if isinstance(m, Quantity)), "")
    quantity = "1" if quantity == "dimensionless" else quantity
    if not (stated or quantity):
        raise TypeError(f"{model.__name__}.{name}: it has no unit; write unit=…, or a type such as Angle")
    if stated and quantity and stated != quantity:
        raise TypeError(f"{model.__name__}.{name}: unit '{stated}' is not that of its type, '{quantity}'")
    return stated or quantity


@dataclass(frozen=True)
class EffectNotes:
    """An effect in words, for the catalogue and for what `pliant diagnose` says; its manifest's summary names it.

    Attributes:
        signature: what gives it away in the data.
        on_the_bench: what to look at or to do at the bench itself, as an order, one sentence.
        look_alike: the kind that it is most easily taken for.
        told_apart: what separates the two.
        excited_by: the run to do so that it shows, as an order to the bench.
        where: the families and chains that it makes sense for, and the engines that follow it.
        origin: `physics`, or `bench` for a mistake of the record (a payload, a clock): the remedy is to correct the
            file, not to extend the model.
    """

    signature: str = ""
    on_the_bench: str = ""
    look_alike: str = ""
    told_apart: str = ""
    excited_by: str = ""
    where: str = ""
    origin: Origin = "physics"


@dataclass(frozen=True, eq=False)
class Model:
    """What effects change: a chain with its law terms, maps of the inputs before it, of the readings after it.

    An input map takes the history of one run and returns the history that reaches the chain. An output map
    takes readings by name (docs/conventions.md) and returns what the sensors say; it leaves other names alone. Where
    the readings are those of a run with a clock, `time_s` (t,) is among them; where the inputs that reach the chain are
    known, so is `actuation` (t,), their sum without signs.
    """

    chain: ChainModel
    inputs: tuple[InputMap, ...] = ()
    outputs: tuple[OutputMap, ...] = ()

    def with_(self, **changes: object) -> Model:
        """A copy with some fields replaced."""
        return replace(self, **changes)  # type: ignore[arg-type]

    def with_input(self, change: InputMap) -> Model:
        """A copy with one more map of its inputs."""
        return replace(self, inputs=(*self.inputs, change))

    def with_term(self, term: LawTerm) -> Model:
        """A copy with one more term in every joint's law."""
        return replace(self, chain=self.chain.with_(terms=(*self.chain.terms, term)))

    def with_output(self, change: OutputMap) -> Model:
        """A copy with one more map of its readings."""
        return replace(self, outputs=(*self.outputs, change))

    def commanded(self, history: History) -> History:
        """What reaches the chain when this history is commanded: closed valves first, then the effects' maps."""
        history = held(history)
        for change in self.inputs:
            history = change(history)
        return history

    def reported(self, readings: Readings) -> Readings:
        """What the sensors say of these readings."""
        for change in self.outputs:
            readings = change(readings)
        return readings


class Effect(Configured[EffectConfig]):
    """One effect at one of four places: input, joint law, chain, output.

    The simulate stage applies a study's `effects` in their order; an effect never changes a model in place and
    keeps no memory: internal states belong to `LawTerm`s, and an input map sees the whole run. The docstring
    of a subclass's file gives the equation and its source. `exciting` names runs of the default catalogue
    (`pliant.experiments.experiment_catalogue`) that show the effect and tell it from its look-alike. `actuation` names
    the input that the chain's laws must take for the effect to make sense (`tendon_force_n`); empty where any does.
    `fitted` is False where an effect's numbers are data that are learned as a whole: it declares no parameter, so that
    no diagnosis tries it.
    """

    place: ClassVar[Place]
    notes: ClassVar[EffectNotes] = EffectNotes()
    exciting: ClassVar[tuple[str, ...]] = ()
    actuation: ClassVar[str] = ""
    fitted: ClassVar[bool] = True

    def unsuited(self, chain: ChainModel, histories: Sequence[History]) -> str:
        """Return why the effect cannot show in recordings like these, whatever its strength; empty where it may.

        A diagnosis leaves out effects that give a reason, so that they cost the others nothing.
        """
        return ""

    @abstractmethod
    def apply(self, model: Model) -> Model:
        """The model with this effect, at the parameter values of the config."""
