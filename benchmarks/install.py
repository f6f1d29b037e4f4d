"""What it takes to install Pliant, and what works of it alone: sdist and wheel are built, the wheel goes into a fresh
environment without any extra and without this checkout, and is tried there.

    python -m benchmarks.install            # an extra at a time, too: what pip would install for it
    python -m benchmarks.install --quick    # without the extras: what CI runs

The wheel is built from the unpacked sdist, so that the sdist is known to be whole. Needs PyPI.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tarfile
import tempfile
import time
import tomllib
import venv
from collections.abc import Sequence
from pathlib import Path

from benchmarks.output import ROOT, Bar, make_parser, write

CONSTRAINTS = ROOT / "constraints.txt"
TURNS = 5
MEGA = 1e-6
LAW = """\
pliant: 1
name: stated
surrogate: {kind: polynomial, form: study, odd: true, coefficients: {k_n: 1.6e-6, m_a: -1.7e-6, m_e: 0.1, b_e: 0.025}}
chain: {modules: 1, module_length: 80 mm, module_mass: 40 g}
physics: quasistatic
task: {kind: free_bending, pressure: 15 kPa}
measurements: {file: bench.csv}
"""
# Notes on the table bellow.csv that `pliant fit` requires.
NOTES = """\
rename: {"p (kPa)": pressure_pa, "theta (deg)": angle_rad, "M (N*mm)": moment_n_m}
angle: half_module
"""
EFFECTS = ("--effect", "stiffness", "--effect", "pressure_offset")
# What works without any extra.
WORKS = {
    "--version": ("--version",),
    "example": ("example", "solver-table"),
    "compare, first time": ("compare", "law.yaml"),
    "compare": ("compare", "law.yaml", "--out", "again"),
    "diagnose": ("diagnose", "law.yaml", *EFFECTS, "--workers", "1"),
    "simulate": ("simulate", "law.yaml"),
    "fit": ("fit", "solver-table/bellow.csv", "--out", "fitted"),
    "plugins": ("plugins",),
    "new-plugin": ("new-plugin", "my-effect"),
}
# Feature that needs an extra → the command that its message must contain.
REFUSED = {
    ("simulate", "law.yaml", "physics=mujoco"): "pip install 'pliant[mujoco]'",
    ("render", "law.yaml", "--out", "film.gif"): "pip install 'pliant[mujoco]'",
    ("fem", "first-finger/finger.yaml"): "pip install 'pliant[fem]'",
    ("run", "first-finger/finger.yaml"): "pip install 'pliant[fem]'",
}


class Environment:
    """A fresh environment in a folder for programs without our variables and paths."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder / "environment"
        self.home = folder / "home"
        self.home.mkdir()
        venv.create(self.folder, with_pip=True)
        self.programs = self.folder / ("Scripts" if os.name == "nt" else "bin")

    def pip(self, *arguments: str) -> str:
        """Return pip's output under the constraints, with this machine's settings."""
        return checked(
            [str(self.programs / "python"), "-m", "pip", *arguments],
            {**os.environ, "PIP_CONSTRAINT": str(CONSTRAINTS)},
            self.home,
        )

    def call(self, program: str, *arguments: str) -> tuple[subprocess.CompletedProcess[str], float]:
        """Run a program of the environment with HOME as the only variable; return its output and seconds."""
        begun = time.perf_counter()
        done = subprocess.run(
            [str(self.programs / program), *arguments],
            cwd=self.home,
            env={"HOME": str(self.home)},
            capture_output=True,
            text=True,
            check=False,
        )
        return done, time.perf_counter() - begun

    def seconds(self, statement: str) -> float:
        """Return the smallest time of an interpreter for a statement, with the byte code from pip."""
        return min(self.call("python", "-c", statement)[1] for _ in range(TURNS))

    def size(self) -> int:
        """Return the bytes of its files."""
        return folder_bytes(self.folder)


def checked(command: Sequence[str], environment: dict[str, str], folder: Path) -> str:
    """Return standard output; raise `SystemExit` if the command fails."""
    done = subprocess.run(command, env=environment, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"{' '.join(command)} ended with {done.returncode}:\n{done.stdout}{done.stderr}")
    return done.stdout


def folder_bytes(folder: Path) -> int:
    """Return bytes of the files below a folder."""
    return sum(path.lstat().st_size for path in folder.rglob("*") if not path.is_dir())


def built(folder: Path) -> tuple[Path, Path]:
    """Build the sdist and a wheel from it."""
    build = [sys.executable, "-m", "hatchling", "build", "--directory", str(folder)]
    checked([*build, "--target", "sdist"], dict(os.environ), ROOT)
    sdist = next(folder.glob("*.tar.gz"))
    with tarfile.open(sdist) as archive:
        archive.extractall(folder, filter="data")
    checked([*build, "--target", "wheel"], dict(os.environ), folder / sdist.name.removesuffix(".tar.gz"))
    return sdist, next(folder.glob("*.whl"))


def write_bench(folder: Path) -> None:
    """Write a stated law, a recording of four short runs with an error of a fifth, and notes on a table."""
    (folder / "law.yaml").write_text(LAW, encoding="utf-8")
    rows = ["run,time_s,pressure_pa,angle_rad"]
    for run, wobble in (("a", 0.004), ("b", -0.004), ("c", 0.003), ("d", -0.003)):
        for k in range(24):
            level = 1.0 - abs(k - 12) / 12
            rows.append(f"{run},{k / 2},{15e3 * level:.1f},{0.42 * level + wobble * (-1) ** k:.5f}")
    (folder / "bench.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")


def tried(environment: Environment) -> tuple[dict[str, float], list[str]]:
    """Return the seconds of commands that work without an extra, and deviations from the expected results."""
    write_bench(environment.home)
    times, wrong = {}, []
    for name, arguments in WORKS.items():
        done, times[name] = environment.call("pliant", *arguments)
        print(f"  pliant {name:<22} {times[name]:6.2f} s")
        if done.returncode:
            wrong.append(f"pliant {' '.join(arguments)} ended with {done.returncode}: {done.stderr}")
        if name == "example":
            (environment.home / "solver-table" / "bellow.yaml").write_text(NOTES, encoding="utf-8")
    environment.call("pliant", "example", "first-finger")
    for arguments, command in REFUSED.items():
        done, _ = environment.call("pliant", *arguments)
        said = done.stderr.strip()
        print(f"  pliant {' '.join(arguments)}: {said}")
        if done.returncode != 2 or command not in said or "\n" in said:
            wrong.append(f"pliant {' '.join(arguments)} ended with {done.returncode}: {said}")
    return times, wrong


def extras() -> list[str]:
    """Return the names of the extras in pyproject.toml."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    return list(project["optional-dependencies"])


def resolved(environment: Environment, wheel: Path) -> dict[str, list[str]]:
    """Return extra → the packages that pip would install for it in this environment."""
    found = {}
    for extra in extras():
        said = environment.pip("install", "--dry-run", "--quiet", "--report", "-", f"{wheel}[{extra}]")
        found[extra] = names = sorted(one["metadata"]["name"] for one in json.loads(said)["install"])
        print(f"  pliant[{extra}]: {', '.join(name for name in names if name != 'pliant')}")
    return found


def main() -> None:
    """Print the figures and write benchmarks/out/install.json; exit code 1 where something does not work."""
    quick = make_parser(__doc__, "leave the extras out").parse_args().quick
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (dist := folder / "dist").mkdir()
        (wheels := folder / "wheels").mkdir()
        sdist, wheel = built(dist)
        environment = Environment(folder)
        environment.pip("download", "--quiet", "--dest", str(wheels), str(wheel))
        environment.pip("install", "--quiet", "--no-index", "--find-links", str(wheels), str(wheel))
        sizes = {
            "sdist": sdist.stat().st_size,
            "wheel": wheel.stat().st_size,
            "download": folder_bytes(wheels),
            "environment": environment.size(),
        }
        for what, size in sizes.items():
            print(f"{what:<12} {MEGA * size:7.1f} MB")
        place = environment.call("python", "-c", "import pliant; print(pliant.__file__)")[0].stdout
        wrong = [] if str(environment.folder) in place else [f"pliant is imported from {place}"]
        bare = environment.seconds("pass")
        numpy, pliant = environment.seconds("import numpy"), environment.seconds("import pliant")
        times, failed = tried(environment)
        wrong += failed
        found = {} if quick else resolved(environment, wheel)
    bars = [
        Bar("import pliant, an interpreter's start included", pliant, 0.3, "s"),
        Bar("import pliant over import numpy", pliant / numpy, 1.0, "×"),
        Bar("commands that do not do what they should without extras", len(wrong), 0, ""),
    ]
    write("install", {"bytes": sizes, "start_s": bare, "seconds": times, "extras": found}, bars)
    print(*wrong, sep="\n")
    raise SystemExit(0 if all(bar.met for bar in bars) else 1)


if __name__ == "__main__":
    main()
