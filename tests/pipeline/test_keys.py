"""The key of a stage depends on everything that changes its result, and on nothing else."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from pydantic import Field

from pliant.config.loading import load_study
from pliant.execution.progress import Silent
from pliant.interfaces.base import FrozenModel
from pliant.pipeline.chain import family_module
from pliant.pipeline.run_folder import finished
from pliant.pipeline.study import simulate_study
from pliant.pipeline.workbench import RunContext, content
from pliant.registry.discovery import discover
from pliant.report.run import run_document, stored_run_page
from pliant.store.store import ArtifactStore
from pliant_plugins.families.reference import FINGER

REGISTRY = discover()
STUDY = {
    "name": "keys",
    "family": {"kind": "bellow_bending", **FINGER},
    "material": {"kind": "neo_hookean", "shear_modulus": "240 kPa"},
    "surrogate": {"kind": "polynomial", "data": "law.csv"},
    "chain": {"segments": [{"modules": 1}, {"modules": 2, "family": {"wall": "1.4 mm"}}]},
    "task": {"kind": "free_bending", "pressure": "2 kPa"},
    "effects": [{"kind": "stiffness", "factor": 1.1}, {"kind": "pressure_offset", "offset": "200 Pa"}],
}


def table(path: Path, stiffness: float = 0.03) -> None:
    rows = [
        f"{p},{u},{1.6e-6 * p - stiffness * u - 1e-6 * p * u}"
        for p in range(0, 15001, 3000)
        for u in (0, 0.2, 0.4)
    ]
    path.write_text("\n".join(["pressure_pa,angle_rad,moment_n_m", *rows]))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("keys")


@pytest.fixture
def run_study(folder):
    def run(stiffness=0.03, **changes):
        table(folder / "law.csv", stiffness)
        (folder / "study.yaml").write_text(json.dumps({**STUDY, **changes}))
        context = RunContext(REGISTRY, ArtifactStore(folder / "store"))
        return simulate_study(context, load_study(folder / "study.yaml", REGISTRY, ()))

    return run


def key(run):
    return run.engines[0].artifact.key


A, B = STUDY["chain"]["segments"]


class Inner(FrozenModel):
    file: Path | None = None


class Outer(FrozenModel):
    file: Path
    inner: Inner = Inner()
    more: tuple[Path, ...] = ()
    named: dict[str, Path] = Field(default={})
    number: float = 0.1


DIFFERENT = {
    "swapped": {"chain": {"segments": [B, A]}},
    "other counts": {"chain": {"segments": [{**A, "modules": 2}, {**B, "modules": 1}]}},
    "turned": {"chain": {"segments": [A, {**B, "rotation": "10 deg"}]}},
    "another wall": {"chain": {"segments": [A, {"modules": 2, "family": {"wall": "1.3 mm"}}]}},
    "one design": {"chain": {"modules": 3}},
    "payload": {"chain": {"segments": [A, B], "payload": "1 g"}},
    "order of effects": {"effects": STUDY["effects"][::-1]},
    "an effect less": {"effects": STUDY["effects"][:1]},
    "content of the table": {"stiffness": 0.031},
    "density": {"material": {"kind": "neo_hookean", "shear_modulus": "240 kPa", "density": 1151}},
    "pressure": {"task": {"kind": "free_bending", "pressure": "2.1 kPa"}},
}
WHOLE = {**A, "rotation": 0}
SAME = {
    "units": [A, {"modules": 2, "family": {"wall_m": 0.0014}}],
    "defaults written out": [WHOLE, {"modules": 2, "family": {"wall": 1.4e-3, "inner_radius": "2 mm"}}],
}


def test_everything_that_matters_changes_the_key_and_another_way_to_write_it_does_not(run_study):
    first = key(run_study())
    keys = {name: key(run_study(**changes)) for name, changes in DIFFERENT.items()}
    assert first not in keys.values() and len(set(keys.values())) == len(keys)
    for segments in SAME.values():
        run = run_study(chain={"segments": segments})
        assert key(run) == first and run.segment_designs == (0, 1)
    assert keys["one design"] == key(run_study(chain={"segments": [{"modules": 3}]}))


def test_a_file_named_by_a_config_counts_by_its_content(tmp_path):
    file, copy = tmp_path / "a.stl", tmp_path / "b.stl"
    file.write_text("one")
    copy.write_text("one")

    def nested_config(path):
        return Outer(file=path, inner=Inner(file=path), more=(path, path), named={"x": path})

    before = content(nested_config(file))
    assert content(nested_config(copy)) == before
    assert before["number"] == 0.1
    file.write_text("two")
    after = content(nested_config(file))
    assert [name for name in before if before[name] != after[name]] == ["file", "inner", "more", "named"]
    assert content(nested_config(tmp_path / "nowhere"))["file"] == str(tmp_path / "nowhere")


def test_without_a_density_a_module_has_that_for_water():
    config = REGISTRY.get("family", "bellow_bending").config_model()
    family = REGISTRY.build("family", config.model_validate(STUDY["family"]))
    water, none = family_module(None, family, 1000.0), family_module(None, family, None)
    assert none.mass.start.mass_kg == water.mass.start.mass_kg


def render_stored(context, run):
    read = finished(run, {})
    stored_run_page(context, run, read).render(run_document(read))


@pytest.mark.slow
def test_the_page_is_drawn_anew_when_an_artifact_was_made_anew(run_study, folder, tmp_path):
    class Notes(Silent):
        def note(self, text):
            pytest.fail(text)

    context = RunContext(REGISTRY, ArtifactStore(folder / "store"), Notes())
    run = run_study()
    render_stored(context, run)
    pages = set((folder / "store" / "report").glob("[0-9a-f]*[0-9a-f]"))
    render_stored(context, run_study())
    assert set((folder / "store" / "report").glob("[0-9a-f]*[0-9a-f]")) == pages
    (run.engines[0].artifact.folder / "value.json").unlink()
    render_stored(context, run_study())
    assert len(set((folder / "store" / "report").glob("[0-9a-f]*[0-9a-f]")) - pages) == 1
