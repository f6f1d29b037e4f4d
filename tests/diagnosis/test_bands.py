"""Bands on runs that no fit has seen, and the part of a posterior that a study keeps."""

import json
from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError
from tests.diagnosis.bench_files import STUDY, bench, csv, histories, study
from tests.diagnosis.quick import BENCH, REGISTRY, effect
from typer.testing import CliRunner

from pliant.cli.verbs import app
from pliant.config.loading import load_study
from pliant.config.posterior import PosteriorConfig
from pliant.diagnosis.bands import bands, study_bands
from pliant.diagnosis.extension import Ground, extend, write_extended_study
from pliant.diagnosis.kept_posterior import kept_posterior
from pliant.diagnosis.posterior import Posterior
from pliant.diagnosis.scatter import ReadingScatter
from pliant.registry.discovery import discover
from pliant.store.store import ArtifactStore

FITTED = (0, 2, 3, 6, 8, 9)  # virgin, fast and half, twice
UNSEEN = (1, 4, 5)  # slow, level, pressed


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("joint")


@pytest.fixture(scope="module")
def written(folder):
    """Return a study with a fitted effect, and its measurement."""
    measurement = bench(folder, effect("viscoelastic"))
    model = study(folder)
    found = extend(Ground.from_study(BENCH, model, measurement), (), ["viscoelastic"], profiles=False)
    target = folder / "new.yaml"
    write_extended_study(folder / "joint.yaml", target, model, (), found, "fitted to bench.csv", discover())
    return target, found, measurement


def part(measurement, runs):
    return replace(measurement, runs=tuple(measurement.runs[k] for k in runs))


@pytest.mark.parametrize("seeds", [3, pytest.param(6, marks=pytest.mark.slow)])
def test_nine_in_ten_readings_in_runs_that_were_not_fitted_lie_within(folder, seeds):
    held = []
    model = study(folder)
    for seed in range(seeds):
        kind = ("viscoelastic", "viscous_damping", "mullins")[seed % 3]
        measurement = bench(folder, effect(kind), seed=seed)
        found = extend(Ground.from_study(BENCH, model, part(measurement, FITTED)), (), [kind], profiles=False)
        unseen = part(measurement, UNSEEN)
        made = bands(Ground.from_study(BENCH, model, unseen).predictor, found.posterior, found.scatter)
        held.append(made.held(unseen)["angle_rad"])
    assert 0.85 <= np.mean(held) <= 0.95
    assert min(held) > 0.7


def test_doubt_about_a_parameter_widens_the_band_where_the_parameter_acts(written):
    _, found, measurement = written
    predictor = Ground.from_study(BENCH, load_study(written[0], REGISTRY), measurement).predictor
    surely = bands(predictor, found.posterior, found.scatter)
    unsure = Posterior(
        found.candidate, found.posterior.x, 100.0 * found.posterior.covariance, found.posterior.freedom
    )
    wide = bands(predictor, unsure, found.scatter)
    pressed = np.argmax(measurement.runs[1].history.actuation["pressure_pa"])
    (a, b) = ((one.high[1]["angle_rad"] - one.low[1]["angle_rad"]) / 2 for one in (surely, wide))
    assert b[0] == pytest.approx(a[0], rel=0.01)  # before any creep
    noise = a[0] ** 2
    assert (b[pressed] ** 2 - noise) / (a[pressed] ** 2 - noise) == pytest.approx(100.0, rel=0.3)


def test_the_band_is_as_wide_as_the_noise_and_as_what_the_fit_left(written):
    _, found, measurement = written
    predictor = Ground.from_study(BENCH, load_study(written[0], REGISTRY), measurement).predictor
    sure = Posterior(found.candidate, found.posterior.x, 1e-12 * found.posterior.covariance, 1e6)
    for scatter, wanted in ((ReadingScatter(0.01, 0.004), 0.01), (ReadingScatter(0.01, 0.03), 0.03)):
        made = bands(predictor, sure, {"angle_rad": scatter}, level=0.9, count=8)
        assert made.half_width()["angle_rad"] == pytest.approx(1.6449 * wanted, rel=1e-3)
    assert bands(predictor, sure, {}).half_width() == {}


def test_a_law_with_an_error_bar_widens_the_band(folder):
    rng, rows = np.random.default_rng(0), ["pressure_pa,angle_rad,moment_n_m"]
    for p in np.linspace(0.0, 15e3, 6):
        for u in np.linspace(-0.3, 0.8, 9):
            moment = 1.637e-6 * p - 1.704e-6 * p * u - 0.1012 * u * abs(u) / 2 - 0.0245 * u
            rows.append(f"{p!r},{u!r},{moment + rng.normal(0, 4e-4)!r}".replace("np.float64", ""))
    (folder / "fem.csv").write_text("\n".join(rows).replace("(", "").replace(")", "") + "\n")
    text = STUDY.replace(STUDY[STUDY.index("surrogate:") : STUDY.index("chain:")], "")
    text += "surrogate: {kind: polynomial, data: fem.csv}\n"
    model = study(folder, text, "fem.yaml")
    measurement = bench(folder, effect("viscoelastic"), runs=histories(1))
    ground = Ground.from_study(replace(BENCH, store=ArtifactStore(folder / "store")), model, measurement)
    assert ground.predictor.chain.laws[0].error is not None
    found = extend(ground, (), ["viscoelastic"], profiles=False)
    exact = ground.predictor.chain.with_(laws=tuple(_exact(law) for law in ground.predictor.chain.laws))
    without = replace_chain(ground.predictor, exact)
    quiet = {"angle_rad": ReadingScatter(1e-6, 0.0)}
    (a, b) = (
        bands(p, found.posterior, quiet, count=16).half_width()["angle_rad"]
        for p in (without, ground.predictor)
    )
    assert b > 1.2 * a


def _exact(law):
    return replace(law, error=None)


def replace_chain(predictor, chain):
    return type(predictor)(predictor.context, predictor.backend, chain, predictor.measurement)


def test_what_a_study_keeps_is_read_back_as_it_was(written):
    target, found, measurement = written
    new = load_study(target, REGISTRY)
    kept = kept_posterior(REGISTRY, new)
    assert kept.posterior.names == found.posterior.names
    assert kept.posterior.x == pytest.approx(found.posterior.x, rel=1e-9)
    assert kept.posterior.covariance == pytest.approx(found.posterior.covariance, rel=1e-5)
    assert kept.scatter["angle_rad"].left == pytest.approx(found.scatter["angle_rad"].left, rel=1e-6)
    made, why = study_bands(BENCH, new, measurement)
    assert why == "" and 0.85 < made.held(measurement)["angle_rad"] < 0.95
    assert study_bands(BENCH, study(target.parent), measurement) == (None, "")


def test_a_posterior_with_other_values_is_not_used_and_reported(written):
    target, _, measurement = written
    for override, word in (("effects.0.share=0.4", "has 0.4"), ("effects=[]", "not among the effects")):
        made, why = study_bands(BENCH, load_study(target, REGISTRY, [override]), measurement)
        assert made is None and word in why


@pytest.mark.parametrize(
    "wrong", [{"sd": (0.1,)}, {"sd": (0.1, -1.0)}, {"correlation": ((1, 0.5), (0.2, 1))}, {"freedom": 0}]
)
def test_a_block_that_is_no_distribution_is_refused(wrong):
    right = {
        "parameters": ("a.b", "a.c"),
        "values": (1.0, 2.0),
        "sd": (0.1, 0.1),
        "correlation": ((1, 0.5), (0.5, 1)),
        "noise": {"angle_rad": 0.01},
        "left": {"angle_rad": 0.01},
        "freedom": 30,
    }
    PosteriorConfig(**right)
    with pytest.raises(ValidationError):
        PosteriorConfig(**{**right, **wrong})


@pytest.mark.slow
def test_compare_shows_what_the_band_holds(written, tmp_path, monkeypatch):
    target, _, measurement = written
    monkeypatch.chdir(tmp_path)
    data = tmp_path / "bench.csv"
    data.write_text(csv(measurement))
    asked = ["compare", str(target), "--data", str(data), "--json", "c.json"]
    shown = CliRunner().invoke(app, asked)
    assert shown.exit_code == 0
    band = json.loads((tmp_path / "c.json").read_text())["band"]
    assert band["level"] == 0.9
    assert 0.85 < band["outputs"]["angle_rad"]["held"] < 0.95
    assert "The 90 % band holds" in shown.output
