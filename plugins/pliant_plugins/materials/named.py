"""Rubbers by name, or by their Shore hardness: each is a law of another kind with constants from `named.yaml`.

Constants are those of an incompressible solid, so that ν is by default the largest that FEM takes. Hardness: `hardness`
(Gent 1958 for Shore A, Hertz for 00).
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any, Literal, Self

from pydantic import Field, model_validator
from ruamel.yaml import YAML

from pliant.errors import closest
from pliant.formatting import quantity
from pliant.interfaces.material import Hyperelastic, Material, Preset
from pliant.mechanics.homogeneous import INCOMPRESSIBLE_RATIO
from pliant.records.design import Array
from pliant.units import Ratio, parse_quantity
from pliant_plugins.materials.hardness import SCATTER, hardness_to_shear_modulus, parse_hardness
from pliant_plugins.materials.mooney_rivlin import MooneyRivlin, MooneyRivlinConfig
from pliant_plugins.materials.neo_hookean import NeoHookean, NeoHookeanConfig
from pliant_plugins.materials.ogden import Ogden, OgdenConfig
from pliant_plugins.materials.rubber import Rubber, RubberConfig
from pliant_plugins.materials.yeoh import Yeoh, YeohConfig

LAWS: dict[str, tuple[type[RubberConfig], type[Rubber]]] = {
    "neo_hookean": (NeoHookeanConfig, NeoHookean),
    "mooney_rivlin": (MooneyRivlinConfig, MooneyRivlin),
    "yeoh": (YeohConfig, Yeoh),
    "ogden": (OgdenConfig, Ogden),
}
NOTABLE = 1.3  # ratio of the sources' moduli from which it is reported


@cache
def table() -> Mapping[str, Mapping[str, Any]]:
    """Return the rows of `named.yaml` by name."""
    read = YAML(typ="safe").load(files(__package__).joinpath("named.yaml").read_text("utf-8"))
    rows: dict[str, dict[str, Any]] = read["materials"]
    return {name: {**row, "source": read["sources"][row["source"]]} for name, row in rows.items()}


class NamedConfig(RubberConfig):
    """A rubber by its name in the table, or by its Shore hardness; `scale` multiplies its moduli."""

    kind: Literal["named"] = "named"
    name: str = Field(default="", description="of the table below, such as Ecoflex 00-30")
    shore: str = Field(
        default="", description="instead of a name: Shore hardness, `30A` or `00-30`; neo-Hookean"
    )
    scale: Ratio = Field(default=1.0, gt=0, description="factor on all moduli: sources differ, batches too")
    poisson_ratio: Ratio = Field(
        default=INCOMPRESSIBLE_RATIO, ge=0, le=INCOMPRESSIBLE_RATIO, description="ν at small strain"
    )

    @model_validator(mode="before")
    @classmethod
    def _fill_density(cls, raw: Any) -> Any:
        """Take the table's density where the study states none."""
        row = table().get(raw.get("name", "")) if isinstance(raw, Mapping) else None
        if row is None or {"density", "density_kg_m3"} & set(raw):
            return raw
        return {**raw, "density_kg_m3": row["density"]}

    @model_validator(mode="after")
    def _known(self) -> Self:
        if bool(self.name) == bool(self.shore):
            raise ValueError(
                "give either a name, such as Ecoflex 00-30, or shore, such as 30A, and leave the other empty"
            )
        if self.shore:
            parse_hardness(self.shore)
        elif self.name not in table():
            same = [known for known in table() if known.lower() == self.name.lower()]
            near = f"; did you mean '{same[0]}'?" if same else closest(self.name, table())
            raise ValueError(f"no rubber is named '{self.name}'{near} Known: {', '.join(table())}")
        return self

    @property
    def law(self) -> RubberConfig:
        """Return the block of the entry's law, with its constants."""
        row: Mapping[str, Any] = table()[self.name] if self.name else {"shore": self.shore}
        block: dict[str, Any] = {"kind": "neo_hookean"}
        if "law" in row:
            block = dict(row["law"])
        elif "modulus_100" in row:
            block["shear_modulus"] = parse_quantity(row["modulus_100"], "Pa") / (2 - 2**-2)
        else:
            block["shear_modulus"] = hardness_to_shear_modulus(row["shore"])
        model = LAWS[block["kind"]][0]
        block |= {"poisson_ratio": self.poisson_ratio, "density_kg_m3": self.density_kg_m3}
        law = model.model_validate(block)
        scaled = {
            name: tuple(self.scale * x for x in value) if isinstance(value, tuple) else self.scale * value
            for name, value in law.model_dump().items()
            if name.endswith("_pa")
        }
        return law.model_copy(update={**scaled, "regions": self.regions})


class Named(Material):
    """A rubber of the table, evaluated by the law of its entry."""

    config: NamedConfig

    def __init__(self, config: NamedConfig) -> None:
        super().__init__(config)
        law = config.law
        self._law = LAWS[law.kind][1](law)

    @property
    def resolved(self) -> Material:
        return self._law

    @property
    def shear_modulus_pa(self) -> float:
        return self._law.shear_modulus_pa

    @property
    def bulk_modulus_pa(self) -> float:
        return self._law.bulk_modulus_pa

    def energy(self, F: Array) -> Array:
        return self._law.energy(F)

    def evaluate(self, F: Array) -> Hyperelastic:
        return self._law.evaluate(F)

    def remarks(self) -> tuple[str, ...]:
        """Return sentences on the uncertainty of the constants, then the remarks of the law."""
        return (*self._doubts(), *super().remarks())

    def _doubts(self) -> list[str]:
        name, modulus = self.config.name, self.shear_modulus_pa
        if not name:
            low, high = (quantity(modulus * factor, "Pa", 2) for factor in SCATTER)
            return [
                f"Shore {self.config.shore} determines a shear modulus of {quantity(modulus, 'Pa', 3)} only roughly: "
                f"those of measured rubbers lie between {low} and {high} there."
            ]
        span = _range(table()[name])
        if span is None or span[1] < NOTABLE * span[0]:
            return []
        low, high = (quantity(value, "Pa", 3) for value in span)
        return [
            f"Sources of {name} differ: a shear modulus of {low} to {high} ({table()[name]['sources_differ'][2]}). "
            "Calibrate yours, or try material.scale."
        ]

    @classmethod
    def presets(cls) -> tuple[Preset, ...]:
        return tuple(_preset(name, row) for name, row in table().items())


def _range(row: Mapping[str, Any]) -> tuple[float, float] | None:
    """Return the lowest and highest shear modulus that sources give, Pa."""
    low, high = row.get("sources_differ", (None, None))[:2]
    return (parse_quantity(low, "Pa"), parse_quantity(high, "Pa")) if low else None


def _preset(name: str, row: Mapping[str, Any]) -> Preset:
    config = NamedConfig(name=name)
    law = config.law
    constants = []
    for field in type(law).model_fields:
        if field not in (*RubberConfig.model_fields, "kind"):
            value, unit = getattr(law, field), "Pa" if field.endswith("_pa") else ""
            numbers = [quantity(v, unit) for v in (value if isinstance(value, tuple) else (value,))]
            constants.append(f"{field.removesuffix('_pa')} {', '.join(numbers)}")
    return Preset(
        name=name,
        config=config,
        law=f"{law.kind}: {'; '.join(constants)}",
        shear_modulus_pa=Named(config).shear_modulus_pa,
        range_pa=_range(row),
        stretch=(float(row["stretch"][0]), float(row["stretch"][1])),
        hardness=row.get("shore", ""),
        source=row["source"] + (f"; {row['sources_differ'][2]}" if "sources_differ" in row else ""),
    )
