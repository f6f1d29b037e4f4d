"""The constants of a material's config, as numbers that a fit may change."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from pydantic import ValidationError

from pliant.config.study import written_name
from pliant.errors import UserError, closest
from pliant.interfaces.material import MaterialConfig

# Numbers of a block that a static test does not decide, or hardly.
NOT_BY_DEFAULT = ("density_kg_m3", "poisson_ratio")
NEVER = "density_kg_m3"
MODULUS = "_pa"


@dataclass(frozen=True)
class Constant:
    """One number of the material's block.

    Attributes:
        field: name of the config's field.
        index: place in the field where that is a list, else None.
        written: how a study writes it: `c10`, `mu.0`.
        value: in SI.
    """

    field: str
    index: int | None
    written: str
    value: float

    @property
    def name(self) -> str:
        """The field, with the place in a list: `c10_pa`, `mu_pa.0`."""
        return self.field if self.index is None else f"{self.field}.{self.index}"

    @property
    def is_modulus(self) -> bool:
        """Whether the energy is proportional to such constants, taken together."""
        return self.field.endswith(MODULUS)

    @property
    def unit(self) -> str:
        return "Pa" if self.is_modulus else ""


def constants_of(config: MaterialConfig) -> tuple[Constant, ...]:
    """All numbers of the block but the density, in the order of its fields."""
    found = []
    for field in type(config).model_fields:
        value, written = getattr(config, field), written_name(type(config), field)
        if field != NEVER and _is_number(value):
            found.append(Constant(field, None, written, float(value)))
        elif isinstance(value, tuple) and value and all(map(_is_number, value)):
            found += [Constant(field, i, f"{written}.{i}", float(v)) for i, v in enumerate(value)]
    return tuple(found)


def chosen(config: MaterialConfig, names: Sequence[str] | None) -> tuple[Constant, ...]:
    """The constants to fit: those named, by field or as a study writes them, or all but Poisson's ratio.

    A list's name means all its numbers. Raises `UserError` for an unknown name or a material without constants.
    """
    known = constants_of(config)
    if not names:
        usual = tuple(c for c in known if c.field not in NOT_BY_DEFAULT)
        if not usual:
            raise UserError(f"material '{config.kind}' has no constants to fit; choose one that has some.")
        return usual
    found: list[Constant] = []
    for name in names:
        if name in (NEVER, "density"):
            raise UserError("--fit density: no static test depends on the density; weigh a sample.")
        named = [c for c in known if name in (c.field, c.name, c.written, c.written.partition(".")[0])]
        if not named:
            words = list(dict.fromkeys(c.written for c in known))
            raise UserError(
                f"--fit {name}: material '{config.kind}' has no such constant{closest(name, words)} "
                f"It has {', '.join(words)}."
            )
        found += [c for c in named if c not in found]
    return tuple(c for c in known if c in found)


def changed(
    config: MaterialConfig, constants: Sequence[Constant], values: Sequence[float]
) -> MaterialConfig | None:
    """The config with these values, or None where it refuses them."""
    fields: dict[str, Any] = config.model_dump()
    for constant, value in zip(constants, values, strict=True):
        if constant.index is None:
            fields[constant.field] = float(value)
        else:
            items = list(fields[constant.field])
            items[constant.index] = float(value)
            fields[constant.field] = tuple(items)
    try:
        return type(config).model_validate(fields)
    except ValidationError:
        return None


def moduli_scaled(config: MaterialConfig, factor: float) -> MaterialConfig | None:
    """The config with every modulus times `factor`: a solid whose stresses are `factor` times as large."""
    moduli = [c for c in constants_of(config) if c.is_modulus]
    return changed(config, moduli, [factor * c.value for c in moduli])


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
