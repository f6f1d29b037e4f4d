"""A fresh environment in which plugin packages are installed in addition to this one's, offline and fast."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
import sysconfig
import venv
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import pytest
from tests.plugins.broken import write_study, write_table

from pliant.cli.plugins import EXAMPLES, create_package

CONTRIB = Path(__file__).parents[2] / "contrib"
CONTRIB_PACKAGES = ("pliant-eccentric-tube", "pliant-calculix", "pliant-pymoo", "pliant-warp")
HAS_PYMOO = importlib.util.find_spec("pymoo") is not None
HAS_WARP = importlib.util.find_spec("mujoco_warp") is not None


def manifest(answer: str, contract: str = "CONTRACT = 3") -> str:
    """Return the code of a manifest with one component."""
    imports = (
        "from pliant.registry.component import Component\nfrom pliant.registry.hookspecs import hookimpl\n"
    )
    return f"{imports}\n{contract}\n\n\n@hookimpl\ndef pliant_components():\n    return [{answer}]\n"


BROKEN = {
    "broken_import": "import a_module_that_nobody_has\n",
    "broken_answer": manifest("'effect'"),
    "broken_twice": manifest(
        "Component('family', 'bellow_helical', 'pliant_plugins.families.bellow_helical.family:BellowHelicalConfig', "
        "'none:Family', 'mine')"
    ),
    # The manifest that `new-plugin` wrote under contract 1.
    "broken_old": manifest(
        "Component('effect', 'old_gain', 'broken_old.config:C', 'broken_old.effect:E', 'a gain')", contract=""
    ),
}


@dataclass(frozen=True)
class Environment:
    """A virtual environment that sees this one's packages."""

    folder: Path

    @property
    def python(self) -> Path:
        return self.folder / "bin" / "python"

    def run(self, *arguments: str | Path, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
        """Run its Python, isolated from this test run."""
        clean = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "VIRTUAL_ENV")}
        command = [str(a) for a in (self.python, *arguments)]
        return subprocess.run(command, cwd=cwd, env=clean, capture_output=True, text=True, check=False)

    def install(self, packages: Sequence[Path]) -> None:
        """Build and install packages without network, dependencies or build isolation."""
        options = "--no-deps --no-build-isolation --no-index --disable-pip-version-check --quiet"
        done = self.run("-m", "pip", "install", *options.split(), *packages)
        assert done.returncode == 0, done.stderr


@pytest.fixture(scope="session")
def broken_packages(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Return packages that fail when imported, return nonsense, and define a shipped kind a second time."""
    parent = tmp_path_factory.mktemp("broken")
    packages = []
    for name, code in BROKEN.items():
        folder = parent / name
        (folder / name).mkdir(parents=True)
        (folder / name / "__init__.py").write_text("")
        (folder / name / "manifest.py").write_text(code)
        (folder / "pyproject.toml").write_text(
            '[build-system]\nrequires = ["hatchling"]\nbuild-backend = "hatchling.build"\n'
            f'[project]\nname = "{name}"\nversion = "0.1"\n'
            f'[project.entry-points.pliant]\n{name} = "{name}.manifest"\n'
        )
        packages.append(folder)
    return packages


@pytest.fixture(scope="session")
def packages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Return by name the packages of contrib whose own requirements are met, and a skeleton of each interface."""
    folder = tmp_path_factory.mktemp("skeletons")
    for interface in EXAMPLES:
        create_package(f"my-{interface}", folder, interface)
    found = {name: CONTRIB / name for name in CONTRIB_PACKAGES}
    return found | {f"my-{interface}": folder / f"my-{interface}" for interface in EXAMPLES}


@pytest.fixture(scope="session")
def environment(
    tmp_path_factory: pytest.TempPathFactory, packages: dict[str, Path], broken_packages: list[Path]
) -> Environment:
    """Return an environment with all packages and the broken ones; pip and hatchling are those of the tests."""
    for module in ("pip", "hatchling"):
        if importlib.util.find_spec(module) is None:
            pytest.skip(f"needs {module} to build packages: pip install {module}")
    folder = tmp_path_factory.mktemp("environment") / "venv"
    venv.create(folder, with_pip=False, symlinks=True)
    site = next(folder.glob("lib/python*/site-packages"))
    # addsitedir, unlike a plain path, also reads the .pth files of editable installs there
    parents = sorted({sysconfig.get_path("purelib"), sysconfig.get_path("platlib")})
    lines = [f"import site; site.addsitedir({parent!r})" for parent in parents]
    (site / "parent.pth").write_text("\n".join(lines) + "\n")
    made = Environment(folder)
    made.install([*packages.values(), *broken_packages])
    return made


@pytest.fixture(scope="session")
def own_tests(
    environment: Environment, packages: dict[str, Path], tmp_path_factory: pytest.TempPathFactory
) -> dict[str, list[str]]:
    """Return the results of each package's own tests, "passed" or the failure, from one interpreter for all."""
    report = tmp_path_factory.mktemp("own_tests") / "report.xml"
    imports = f"pythonpath={packages['pliant-calculix'] / 'tests'}"  # as in its pyproject.toml
    options = ["-q", "-p", "no:cacheprovider", "--import-mode=importlib", "--rootdir=/"]
    has = {"pliant-pymoo": HAS_PYMOO, "pliant-warp": HAS_WARP}
    ready = [folder for name, folder in packages.items() if has.get(name, True)]
    tests = [folder / "tests" for folder in ready]
    options += ["-o", imports, f"--junitxml={report}"]
    done = environment.run("-m", "pytest", *options, *tests, cwd=report.parent)
    assert report.is_file(), done.stdout[-3000:]
    became: dict[str, list[str]] = {name: [] for name in packages}
    for case in ElementTree.parse(report).iter("testcase"):
        (package,) = set(case.get("classname", "").split(".")) & set(packages)
        failed = [part.get("message", "") for part in case if part.tag in ("failure", "error")]
        became[package].append(f"{case.get('name')}: {failed[0]}" if failed else "passed")
    return became


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Yield a folder for packages, in a working folder that contains a study which names none of them."""
    folder = tmp_path / "site"
    folder.mkdir()
    monkeypatch.syspath_prepend(folder)
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("PLIANT_STORE", raising=False)
    write_study(tmp_path)
    write_table(tmp_path / "fem.csv")
    yield folder
    laid = {package.name for package in folder.iterdir()}
    for name in list(sys.modules):
        if name.partition(".")[0] in laid:
            del sys.modules[name]
