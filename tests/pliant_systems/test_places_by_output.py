"""Which kinds are tried at single places: those that explain an output, though not all outputs alike."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pliant.diagnosis import places
from pliant.diagnosis.evidence_table import NOTHING
from pliant.diagnosis.excitation import explained_by
from pliant.diagnosis.places import _explained_by_output, _Point, _where_most_is_left
from pliant.diagnosis.readings import ReadingVector
from pliant.records.history import History
from pliant.records.measurement import MeasuredRun, Measurement


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


def test_every_kind_that_could_explain_a_quarter_of_the_best_is_tried_at_its_places(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rng = np.random.default_rng(2)
    residual = rng.normal(size=400)
    strange = np.linalg.qr(np.column_stack([residual, rng.normal(size=(400, 7))]))[0][:, 1:]
    strange *= np.linalg.norm(residual)
    explained = dict(zip("abcdefg", (0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.1), strict=True))
    changes = {
        kind: np.sqrt(share) * residual + np.sqrt(1.0 - share) * strange[:, k]
        for k, (kind, share) in enumerate(explained.items())
    }
    search = search_of(changes, residual, np.zeros(400, int))
    search.table, search.thresholds, search.registry, search.fitter = lambda: None, None, None, None
    model = SimpleNamespace(places_of_kind=lambda kind: [f"{kind}@1", f"{kind}@2"])
    asked: list[str] = []

    def applicable(registry: Any, fitter: Any, kinds: list[str], executor: Any) -> tuple[list[str], None]:
        asked.extend(kinds)
        return [], None

    monkeypatch.setattr(places, "log_evidence", lambda *_: {(kind,): ord(kind) for kind in explained})
    monkeypatch.setattr(places, "applicable", applicable)
    monkeypatch.setattr(places, "_most_explaining", lambda *_: [])
    monkeypatch.setattr(places, "excitations", lambda *_: {})
    places.kinds_at_places(search, model, None)  # type: ignore[arg-type]
    # all by what they explain, and g, the first by evidence; none of them is limited in number
    assert asked == [f"{kind}@{place}" for kind in "abcdefg" for place in (1, 2)]
    asked.clear()
    monkeypatch.setattr(places, "log_evidence", lambda *_: {(kind,): -ord(kind) for kind in explained})
    places.kinds_at_places(search, model, None)  # type: ignore[arg-type]
    assert "g@1" not in asked  # a ninth of what the best explains


def test_places_are_screened_in_the_runs_that_hold_most_of_the_error() -> None:
    clock = np.arange(5.0)
    history = History.from_arrays({"drive": clock}, clock)
    one = MeasuredRun(history, {"a": clock, "b": clock}, {}, np.ones(5), np.arange(5.0))
    runs = tuple(replace(one, history=replace(history, run=f"run_{k}")) for k in range(6))
    measurement = Measurement(runs, ("a", "b"), "made here")
    readings = ReadingVector.from_measurement(measurement, ("a", "b"), {"a": 1.0, "b": 2.0})
    raw = np.array([1.0, 0.1, 5.0, 0.1, 2.0, 0.2])[readings.run]
    search = SimpleNamespace(
        readings=readings,
        measurement=measurement,
        fits={NOTHING: SimpleNamespace(raw=raw)},
        fitter=SimpleNamespace(predictor=SimpleNamespace(for_runs=lambda measured: measured)),
    )
    fitter, there = _where_most_is_left(search)  # type: ignore[arg-type]
    assert [run.name for run in fitter.predictor.runs] == ["run_0", "run_2", "run_4"]  # type: ignore[attr-defined]
    assert np.array_equal(fitter.readings.values, readings.values[there])
    assert set(np.abs(raw[there])) == {1.0, 5.0, 2.0}


def test_a_place_is_looked_at_with_the_strength_that_the_residual_would_need() -> None:
    candidate = SimpleNamespace(parameters=[None, SimpleNamespace(limits=(0.0, 4.0))])
    point = _Point("leak@drive1", candidate, np.array([0.5, 0.3]), 1)  # type: ignore[arg-type]
    change = np.array([1.0, -2.0, np.nan, 0.5])
    assert point.scaled(change, 3.0 * change).x == pytest.approx([0.5, 0.9])
    assert point.scaled(change, 100.0 * change).x == pytest.approx([0.5, 4.0])
    assert point.scaled(change, -change).x == pytest.approx([0.5, 0.0])
    assert point.scaled(0.0 * change, change).x == pytest.approx([0.5, 0.0])
