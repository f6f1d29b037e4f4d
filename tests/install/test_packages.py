"""The sdist is complete and the wheel contains what commands read; examples are those of the checkout."""

import tarfile
import tomllib
import zipfile
from pathlib import Path

import numpy as np
import pytest
from benchmarks.install import built
from tests.command import called

from pliant.examples_shipped import EXAMPLES
from pliant.measurements.reading import read_measurement

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def packages(tmp_path_factory):
    """Return the names in the sdist, without its folder, and in the wheel that is built of it."""
    sdist, wheel = built(tmp_path_factory.mktemp("dist"))
    with tarfile.open(sdist) as archive:
        sources = {name.partition("/")[2] for name in archive.getnames()}
    with zipfile.ZipFile(wheel) as archive:
        return sources, set(archive.namelist())


def test_the_sdist_has_code_licence_and_readme_and_no_tests(packages):
    sources, _ = packages
    assert {
        "LICENSE",
        "README.md",
        "pyproject.toml",
        "core/pliant/py.typed",
        "plugins/pliant_plugins/py.typed",
    } <= sources
    assert [name for name in sources if name.startswith(("tests/", "benchmarks/", "contrib/", "docs/"))] == []


def test_the_wheel_has_every_file_in_the_packages_and_the_examples(packages):
    _, names = packages
    wanted = {
        path.relative_to(ROOT / folder).as_posix()
        for folder in ("core", "plugins")
        for path in (ROOT / folder).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    examples = {
        f"pliant/examples/{folder}/{file}" for folder, files, _ in EXAMPLES.values() for file in files
    }
    made = {name for name in names if ".dist-info/" not in name}
    assert made == wanted | examples


def test_examples_are_packaged_from_where_they_stand():
    wheel = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["hatch"]["build"]["targets"][
        "wheel"
    ]
    for file, place in wheel["force-include"].items():
        assert (ROOT / file).is_file()
        assert place == f"pliant/{file}"


def test_the_german_recording_is_the_same(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("hidden-effect", "german-lab"):
        called("example", name).done()
    plain, german = (read_measurement(Path(name, "bench.csv")) for name in ("hidden-effect", "german-lab"))
    assert Path("german-lab/bench.csv").read_bytes().startswith(b"Messung;Probe;Zeit [ms];Druck [mbar];")
    for one, other in zip(plain.runs, german.runs, strict=True):
        assert (one.name, one.history.specimen) == (other.name, other.history.specimen)
        np.testing.assert_allclose(other.history.time_s, one.history.time_s, rtol=1e-5)
        for output, values in one.outputs.items():
            np.testing.assert_allclose(other.outputs[output], values, rtol=1e-4, atol=1e-6)


def test_an_example_overwrites_nothing(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("finger.yaml").write_text("mine")
    called("example", "hidden-effect", "--out", ".").refused("finger.yaml: there already")
    assert Path("finger.yaml").read_text() == "mine"
    called("example", "german").refused("did you mean 'german-lab'?")
