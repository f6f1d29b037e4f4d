"""Fresh environments into which plugin packages are installed beside this one's packages, offline and fast."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sysconfig
import venv
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def manifest(answer: str, contract: str = "CONTRACT = 2") -> str:
    """The code of a manifest with one component."""
    imports = (
        "from pliant.registry.component import Component\nfrom pliant.registry.hookspecs import hookimpl\n"
    )
    return f"{imports}\n{contract}\n\n\n@hookimpl\ndef pliant_components():\n    return [{answer}]\n"


BROKEN = {
    "broken_import": "import a_module_that_nobody_has\n",
    "broken_answer": manifest("'effect'"),
    "broken_twice": manifest("Component('family', 'bellow_bending', 'none:Config', 'none:Family', 'mine')"),
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
        """Run its Python; nothing of this test run leaks in."""
        clean = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "VIRTUAL_ENV")}
        command = [str(a) for a in (self.python, *arguments)]
        return subprocess.run(command, cwd=cwd, env=clean, capture_output=True, text=True, check=False)

    def install(self, packages: Sequence[Path]) -> None:
        """Build and install packages without network, dependencies or build isolation."""
        options = "--no-deps --no-build-isolation --no-index --disable-pip-version-check --quiet"
        done = self.run("-m", "pip", "install", *options.split(), *packages)
        assert done.returncode == 0, done.stderr


@pytest.fixture(scope="session")
def new_environment(tmp_path_factory: pytest.TempPathFactory) -> Callable[[], Environment]:
    """Makes an environment; pip and hatchling come from the one that runs the tests."""
    for module in ("pip", "hatchling"):
        if importlib.util.find_spec(module) is None:
            pytest.skip(f"needs {module} to build packages: pip install {module}")

    def make() -> Environment:
        folder = tmp_path_factory.mktemp("environment") / "venv"
        venv.create(folder, with_pip=False, symlinks=True)
        site = next(folder.glob("lib/python*/site-packages"))
        # addsitedir, unlike a plain path, also reads the .pth files of editable installs there
        parents = sorted({sysconfig.get_path("purelib"), sysconfig.get_path("platlib")})
        lines = [f"import site; site.addsitedir({parent!r})" for parent in parents]
        (site / "parent.pth").write_text("\n".join(lines) + "\n")
        return Environment(folder)

    return make


@pytest.fixture(scope="session")
def contrib() -> Path:
    """The third-party family of this repository."""
    return ROOT / "contrib" / "pliant-eccentric-tube"


@pytest.fixture(scope="session")
def broken_packages(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Packages that fail when imported, answer nonsense, and define a shipped kind a second time."""
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
