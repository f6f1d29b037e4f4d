"""Keys of a study's task by their written names, and configs with some of them changed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pliant.config.study import nested_model, written_name
from pliant.errors import UserError, closest
from pliant.interfaces.base import FrozenModel
from pliant.interfaces.task import TaskConfig
from pliant.units import si_unit

BLOCK = "task."
NOT_CONDITIONS = ("kind", "trials", "seed", "noise", "outside_domain")


@dataclass(frozen=True)
class TaskKey:
    """A key of a task's config.

    Attributes:
        path: field names from the task down.
        unit: the unit that the written name ends with where that is not the field's own (`pressure_kpa`), or "".
        si: the field's SI unit, "" for pure numbers and texts.
    """

    path: tuple[str, ...]
    unit: str
    si: str

    @property
    def dotted(self) -> str:
        """The key as a study's dotted text, ``task.object.radius_m``."""
        return BLOCK + ".".join(self.path)


def find_key(task: type[TaskConfig], written: str, endings: Mapping[str, str]) -> TaskKey | None:
    """Return the key that a column's name or a dotted text means; None if the task has no such key.

    Args:
        task: the config model.
        written: ``task.pressure``, ``pressure_pa``, ``pressure_kpa``, ``object.radius``.
        endings: endings of names that are units, in lower case → the unit.
    """
    model: type[FrozenModel] | None = task
    path: list[str] = []
    unit = ""
    for part in written.strip().removeprefix(BLOCK).lower().split("."):
        if model is None or unit:
            return None
        field, unit = _field(model, part, endings)
        if field is None or (not path and field in NOT_CONDITIONS):
            return None
        path.append(field)
        model = nested_model(model.model_fields[field].annotation)
    return TaskKey(tuple(path), unit, si_unit(path[-1]))


def need_key(task: type[TaskConfig], written: str, endings: Mapping[str, str], where: str) -> TaskKey:
    """Return `find_key`, or raise `UserError` that begins with `where` and names the closest key."""
    found = find_key(task, written, endings)
    if found is None:
        known = known_keys(task)
        if not written.startswith(BLOCK):
            known = [name.removeprefix(BLOCK) for name in known]
        raise UserError(
            f"{where} '{written}', which is no key of the study's task that a condition can set"
            f"{closest(written, known)} It has {', '.join(known)}."
        )
    return found


def known_keys(task: type[TaskConfig]) -> list[str]:
    """Return the keys that a condition may set, as people write them, including those of blocks inside the task."""
    return [BLOCK + key for key in _keys(task) if key.partition(".")[0] not in NOT_CONDITIONS]


def changed_task(task: TaskConfig, changes: Mapping[str, Any]) -> TaskConfig:
    """Return the config with dotted keys set, one after another, each validated with its units.

    Raises:
        pydantic.ValidationError: a value that the task does not allow.
    """
    for key, value in changes.items():
        task = _changed(task, key.removeprefix(BLOCK).split("."), value)  # type: ignore[assignment]
    return task


def value_at(task: TaskConfig, key: TaskKey) -> Any:
    """Return the config's value at a key, SI; None where a block above it is not given."""
    value: Any = task
    for part in key.path:
        value = getattr(value, part, None)
    return value


def _changed(config: FrozenModel, path: Sequence[str], value: Any) -> FrozenModel:
    values = {written_name(type(config), name): v for name, v in config.model_dump(mode="json").items()}
    inner = getattr(config, path[0], None)
    if len(path) > 1:
        if not isinstance(inner, FrozenModel):
            raise UserError(f"'{'.'.join(path)}' cannot be set: the task has no block '{path[0]}'.")
        value = _changed(inner, path[1:], value).model_dump(mode="json")
    values[written_name(type(config), path[0])] = value
    return type(config).model_validate(values)


def _field(model: type[FrozenModel], part: str, endings: Mapping[str, str]) -> tuple[str | None, str]:
    """Return the field's name, and the unit in the written name if it differs from the field's own."""
    for name in model.model_fields:
        if part in (name, written_name(model, name)):
            return name, ""
    words = part.split("_")
    for cut in range(1, len(words)):
        ending = endings.get("_".join(words[cut:]), "")
        for name in model.model_fields if ending else ():
            if si_unit(name) and written_name(model, name) == "_".join(words[:cut]):
                return name, ending
    return None, ""


def _keys(model: type[FrozenModel]) -> Iterator[str]:
    for name, field in model.model_fields.items():
        yield written_name(model, name)
        inner = nested_model(field.annotation)
        for below in _keys(inner) if inner is not None else ():
            yield f"{written_name(model, name)}.{below}"
