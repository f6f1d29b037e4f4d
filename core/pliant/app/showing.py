"""What the page shows of a model and of recordings that no study reads, as JSON values."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pliant import api
from pliant.app import work
from pliant.app.folder import SessionFolder, key_of
from pliant.app.open_model import OpenModel
from pliant.app.page_state import PageState, PageStep
from pliant.app.unseen_runs import doubts_by_hand
from pliant.diagnosis.noise import NoiseView
from pliant.errors import PliantError


def shown(
    model: OpenModel, state: PageState, folder: SessionFolder, effects: list[dict[str, Any]]
) -> dict[str, Any]:
    """Everything of a model but its curves, as JSON values.

    Args:
        model: what is open, without the readings that are switched off.
        state: where the session is.
        folder: of the session, which holds results.
        effects: what can be ticked (`screening.catalogue`).
    """
    now = state.now
    predicted = model.predicted(now.effects)
    noise = model.noise(predicted)
    diagnosis = folder.result(key_of("diagnose", model.key, now.effects))
    of_study = folder.result(key_of("diagnose", model.key, model.own_effects))
    result = folder.result(now.result) if now.result else None
    own = {effect.kind for effect in model.study.effects}
    added = [str(one["kind"]) for one in now.effects if one["kind"] not in own]
    warnings = list(result["warnings"]) if result else []
    warnings += work.doubts_of(added, of_study) if of_study else []
    if result is None:
        warnings += doubts_by_hand(model, now.effects, added, noise)
    return {
        "name": model.study.name,
        "source": model.measurement.source,
        "doubts": [doubt.sentence for doubt in model.measurement.doubts],
        "aside": model.split.why,
        "effects": now.effects,
        "first": model.own_effects,
        "own": sorted(own),
        "off": list(now.off),
        "catalogue": effects,
        "cursor": state.cursor,
        "steps": [
            {
                "words": step.words,
                "fitted": bool(step.result),
                "effects": step.effects,
                **_score(model, step, noise),
            }
            for step in state.steps
        ],
        "fit": result,
        "warnings": warnings,
        "diagnosis": diagnosis,
        "judged": noise.judged,
    }


def _score(model: OpenModel, step: PageStep, noise: NoiseView) -> dict[str, Any]:
    """Errors of a step over the present floor; with other runs switched off they are of its own runs."""
    held = model.without(step.off)
    try:
        predicted = model.predicted(step.effects)
    except PliantError:
        return {"error": None, "aside": None}
    errors = held.errors(predicted, noise)
    return {"error": errors.fitted, "aside": errors.aside}


def recording(data: Sequence[str]) -> dict[str, Any] | None:
    """How dropped recordings are understood while no study reads them."""
    if not data:
        return None
    try:
        measurement, document = api.read([str(one) for one in data], {})
    except PliantError as error:
        return {"refused": str(error)}
    return {
        "sentence": document.sentence,
        "doubts": [doubt.sentence for doubt in measurement.doubts],
        "columns": [
            {"heading": one["heading"], "unit": one["unit"], "name": one["name"]}
            for one in document.data["columns"]
        ],
    }
