"""A study with the effects of an extension, as a file: values with their units, uncertainty beside them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from pydantic import ValidationError

from pliant.config.measurements import MeasurementsConfig
from pliant.config.study import Study, written_name
from pliant.config.writing import StudyDraft
from pliant.diagnosis.extension import Extension
from pliant.diagnosis.uncertainty import Estimate
from pliant.interfaces.effect import EffectConfig
from pliant.registry.discovery import Registry


def write_extended_study(
    source: Path,
    target: Path,
    study: Study,
    overrides: Sequence[str],
    found: Extension,
    note: str,
    registry: Registry,
    *,
    notes_by_kind: Mapping[str, str] | None = None,
    data: Sequence[Path] | None = None,
    full: bool = False,
) -> None:
    """Write the study with the effects of an extension.

    Args:
        source: the study's file.
        target: the new file.
        study: as it was read from `source` with `overrides`.
        found: the fitted effects.
        note: where they come from, one line.
        registry: as it was before the study's own plugin files were read.
        notes_by_kind: more words behind the note, by kind of effect.
        data: the measurement that was fitted where it is not the study's; a single one becomes the new study's.
        full: whether the file shall stand alone.

    Raises:
        UserError: the file cannot be written, or what was written does not read back as the same study.
    """
    draft = StudyDraft(source, overrides)
    meant = {**study.canonical(), "effects": [effect.canonical() for effect in found.effects]}
    if data is not None and len(data) == 1:
        file = str(data[0].absolute())
        draft.set(("measurements", "file"), file)
        block = study.measurements or MeasurementsConfig(file=file)
        meant["measurements"] = {**block.canonical(), "file": file}
    for slot, kind in sorted(zip(found.candidate.slots, found.kinds, strict=True)):
        at = ("effects", slot)
        draft.set((*at, "kind"), kind, note + (notes_by_kind or {}).get(kind, ""))
        for estimate in found.uncertainty.estimates:
            if estimate.kind == kind:
                key, value = _written(found.effects[slot], estimate, found.values[estimate.name])
                draft.set((*at, key), value, estimate.words)
    draft.write(target, meant, registry, full)


def _written(config: EffectConfig, estimate: Estimate, value: float) -> tuple[str, str | float]:
    """Key and value as a study has them: with its unit where the config reads one, else the bare SI number."""
    field = estimate.parameter.name
    key = written_name(type(config), field)
    text = f"{repr(float(value)).removesuffix('.0')} {estimate.unit}"
    if key != field and estimate.unit:
        try:
            read = type(config).model_validate({**config.model_dump(), field: text})
        except ValidationError:
            return field, float(value)
        if abs(getattr(read, field) - value) <= 1e-12 * abs(value):
            return key, text
    return field, float(value)
