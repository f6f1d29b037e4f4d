"""A study with fitted effects as a file: where it goes, what stands in it, and that it reads back as meant."""

from __future__ import annotations

import copy
import os
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from pliant.cli.session import check_writable
from pliant.config.loading import load_study
from pliant.config.paths import change_paths
from pliant.config.study import Study, written_name
from pliant.config.writing import EffectEntry, study_with_effects
from pliant.diagnosis.extension import Extension
from pliant.diagnosis.uncertainty import Estimate
from pliant.errors import UserError
from pliant.interfaces.effect import EffectConfig
from pliant.registry.discovery import Registry


def check_target(source: Path, target: Path, force: bool) -> None:
    """Refuse a place that cannot be written or that holds something, before any work is done."""
    if os.path.isdir(target):  # noqa: PTH112 - never raises
        raise UserError(
            f"--out needs the name of a file, and {target} is a folder; try {target / 'new.yaml'}."
        )
    if os.path.realpath(target) == os.path.realpath(source):
        raise UserError(f"{target} is the study itself, which is never overwritten; give another --out.")
    if os.path.exists(target) and not force:  # noqa: PTH110 - never raises
        raise UserError(f"{target} is there already; give another --out, or --force to overwrite it.")
    check_writable(target.parent)


def write_study(
    source: Path,
    target: Path,
    study: Study,
    overrides: Sequence[str],
    found: Extension,
    note: str,
    registry: Registry,
    beside: Mapping[str, str] | None = None,
) -> None:
    """Write the study with the effects of an extension.

    Args:
        source: the study's file.
        target: the new file, see `check_target`.
        study: as it was read from `source` with `overrides`.
        found: the fitted effects.
        note: where they come from, one line.
        registry: as it was before the study's own plugin files were read.
        beside: more words behind the note, by kind of effect.

    Raises:
        UserError: the file cannot be written, or what was written does not read back as the same study.
    """
    present = [effect.canonical() for effect in study.effects]
    text = study_with_effects(source, target, _entries(study, found, note, beside or {}), present, overrides)
    meant = {**study.canonical(), "effects": [effect.canonical() for effect in found.effects]}
    write_checked(target, text, meant, registry)


def write_checked(target: Path, text: str, meant: Mapping[str, Any], registry: Registry) -> None:
    """Write a study's text, whole or not at all.

    Args:
        target: the new file, see `check_target`.
        text: what to write.
        meant: the study as canonical values, which the text must read back as.
        registry: as it was before the study's own plugin files were read.

    Raises:
        UserError: the file cannot be written, or what was written does not read back as meant.
    """
    handle, name = tempfile.mkstemp(prefix=".writing-", suffix=".yaml", dir=target.parent)
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
        _check(Path(name), meant, registry)
        Path(name).chmod(0o644)
        Path(name).replace(target)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def _entries(study: Study, found: Extension, note: str, beside: Mapping[str, str]) -> list[EffectEntry]:
    entries = []
    for slot, kind in sorted(zip(found.candidate.slots, found.kinds, strict=True)):
        config = found.effects[slot]
        values, comments = {}, {}
        for estimate in found.uncertainty.estimates:
            if estimate.kind == kind:
                key, values[key] = _written(config, estimate, found.values[estimate.name])
                comments[key] = estimate.words
        at = slot if slot < len(study.effects) else None
        entries.append(EffectEntry(kind, values, comments, note + beside.get(kind, ""), at))
    return entries


def _written(config: EffectConfig, estimate: Estimate, value: float) -> tuple[str, str]:
    """Key and text of a value: with its unit where the config reads one, else the bare SI number."""
    field = estimate.parameter.name
    plain = repr(float(value)).removesuffix(".0")
    key = written_name(type(config), field)
    text = f"{plain} {estimate.unit}"
    if key != field and estimate.unit:
        try:
            read = type(config).model_validate({**config.model_dump(), field: text})
        except ValidationError:
            return field, plain
        if abs(getattr(read, field) - value) <= 1e-12 * abs(value):
            return key, text
    return field, plain


def _check(path: Path, canonical: Mapping[str, Any], registry: Registry) -> None:
    """What was written must read back as the study that was meant."""
    meant = _comparable(canonical)
    read = _comparable(load_study(path, registry).canonical())
    different = [key for key in meant if meant[key] != read.get(key)]
    if different:
        raise UserError(
            f"the new study would not say the same as the old one in {', '.join(different)}; write overrides, anchors "
            "and merges ('&', '*', '<<') out in the study and try again."
        )


def _comparable(canonical: Mapping[str, Any]) -> dict[str, Any]:
    """The study as values, paths resolved."""
    study = {"plugins": [], **copy.deepcopy(dict(canonical))}
    change_paths(study, os.path.realpath)
    return study
