"""Components whose config, example or manifest entry is wrong; the good one is the small solid."""

from typing import Literal

from pydantic import ConfigDict, field_serializer

from broken import Variants
from broken.material import Solid, SolidConfig
from broken.material import variants as material
from pliant.interfaces.material import MaterialConfig
from pliant.interfaces.task import TaskConfig
from pliant.testing.stand_ins import Ciarlet
from pliant.units import Length

variants = Variants(material.good)
variants.add("example_is_valid", "no_such_field", example={"no_such_field": 1})
variants.add("describes_itself", "not one line", summary="two\nlines")
variants.add(
    "config_imports_nothing_heavy",
    "imports sqlite3",
    config="broken.heavy:HeavyConfig",
    requires=("sqlite3",),
)


@variants.by_config("config_subclasses_the_interface", "no MaterialConfig")
class OtherBlock(TaskConfig):
    """The config of another interface."""

    kind: Literal["small"] = "small"


@variants.by_config("config_names_its_kind", r"not Literal\['small'\]")
class AnyKind(SolidConfig):
    """Accepts any kind."""

    kind: str = "small"  # type: ignore[assignment]


@variants.by_config("config_refuses_unknown_keys", "'no_such_key' was accepted")
class Lenient(SolidConfig):
    """Ignores what it does not know."""

    model_config = ConfigDict(extra="ignore")


@variants.by_config("config_is_frozen", "could be assigned")
class Mutable(SolidConfig):
    """May be changed after validation."""

    model_config = ConfigDict(frozen=False)


@variants.by_config("config_survives_json", "lame_pa|Pa|differs")
class OneWay(SolidConfig):
    """Serialises a number as a text that it does not read back alike."""

    @field_serializer("lame_pa")
    def _rounded(self, value: float) -> float:
        return round(value * 1.5)


@variants.by_config("quantities_carry_their_unit", "does not end in _m")
class NoUnit(SolidConfig):
    """A length whose name does not say so."""

    grain: Length = 1e-3


@variants.by("implementation_fills_the_interface", "does not subclass Material")
class Duck:
    """Looks like a material."""

    def __init__(self, config: MaterialConfig) -> None:
        self.config = config
        self.energy = Ciarlet(config).energy  # type: ignore[arg-type]


@variants.by("building_leaves_the_config_alone", "the config changed")
class Rounds(Solid):
    """Normalises the config behind pydantic's back."""

    def __init__(self, config: SolidConfig) -> None:
        config.__dict__["lame_pa"] = 1e5
        super().__init__(config)
