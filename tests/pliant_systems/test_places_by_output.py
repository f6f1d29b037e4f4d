"""Which kinds are tried at single places: those that explain an output, though not all outputs alike."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pliant.diagnosis.evidence_table import NOTHING
from pliant.diagnosis.excitation import explained_by
from pliant.diagnosis.places import _explained_by_output


def search_of(changes: dict[str, Any], residual: Any, output: Any) -> Any:
    """Return what the function asks of a search: effects that change the readings like this, and no fit of them."""
    size, none = len(residual), np.zeros((len(residual), 0))
    nothing = SimpleNamespace(raw=residual, residual=residual)
    shown = {kind: SimpleNamespace(change=change, slopes=none) for kind, change in changes.items()}
    fits: dict[Any, Any] = {(kind,): SimpleNamespace(raw=residual, slopes=none) for kind in changes}
    readings = SimpleNamespace(output=output)
    assert all(len(change) == size for change in changes.values())
    return SimpleNamespace(shown=shown, fits={**fits, NOTHING: nothing}, readings=readings)


def test_an_effect_at_one_place_is_seen_in_its_output() -> None:
    rng = np.random.default_rng(1)
    output = np.repeat([0, 1, 2], 50)
    friction, lag = rng.normal(size=150), rng.normal(size=150)
    residual = np.where(output == 1, friction, 0.0)  # friction at the second joint alone
    blurred = np.where(output == 1, 0.55 * friction + 0.5 * lag, 0.1 * lag)  # a rival that is like it there
    search = search_of({"friction": friction, "blurred": blurred}, residual, output)
    alike = {kind: explained_by(residual, search.shown[kind]) for kind in search.shown}
    assert alike["blurred"] > alike["friction"]  # at all places alike the rival leads
    assert _explained_by_output(search, "friction") == pytest.approx(float(residual @ residual))
    assert _explained_by_output(search, "friction") > _explained_by_output(search, "blurred")
