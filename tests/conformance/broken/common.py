"""Components with a wrong config, example or manifest entry; the correct one is the small solid."""

from typing import Any, Literal

from pydantic import ConfigDict, field_serializer
from tests.conformance.broken import Variants
from tests.conformance.broken.material import Solid, SolidConfig
from tests.conformance.broken.material import variants as material

from pliant.interfaces.task import TaskConfig
from pliant.units import Length

variants = Variants(material.good)
variants.add("example_is_valid", example={"no_such_field": 1})
variants.add("describes_itself", summary="two\nlines")
variants.add(
    "config_imports_nothing_heavy", config="tests.conformance.broken.heavy:HeavyConfig", requires=("sqlite3",)
)


@variants.by_config("config_subclasses_the_interface")
class OtherBlock(TaskConfig):
    """The config of another interface."""

    kind: Literal["small"] = "small"


@variants.by_config("config_names_its_kind")
class AnyKind(SolidConfig):
    """A config that accepts any kind."""

    kind: str = "small"  # type: ignore[assignment]


@variants.by_config("config_refuses_unknown_keys")
class Lenient(SolidConfig):
    """A config that ignores unknown keys."""

    model_config = ConfigDict(extra="ignore")


@variants.by_config("config_is_frozen")
class Mutable(SolidConfig):
    """A config that can be changed after validation."""

    model_config = ConfigDict(frozen=False)


@variants.by_config("config_survives_json")
class OneWay(SolidConfig):
    """A config that serialises a number as a text that it reads back differently."""

    @field_serializer("lame_pa")
    def _rounded(self, value: float) -> float:
        return round(value * 1.5)


@variants.by_config("quantities_carry_their_unit")
class NoUnit(SolidConfig):
    """A config with a length whose name does not state its unit."""

    grain: Length = 1e-3


def _rounding(up: Any, self: Any, config: SolidConfig) -> None:
    config.__dict__["lame_pa"] = 1e5  # bypasses pydantic
    up(config)


class Anything:
    """A component without an interface, with a config."""

    def __init__(self, config: SolidConfig) -> None:
        self.config = config


variants.row_adder(Anything)("implementation_fills_the_interface", energy=None)
variants.row_adder(Solid)("building_leaves_the_config_alone", __init__=_rounding)
