"""What benchmarks share: folders, options, engines, bars with the figure reached, tables, times, result files."""

from __future__ import annotations

import argparse
import json
import os
import platform
import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pliant.errors import MissingDependencyError
from pliant.interfaces.physics import PhysicsBackend
from pliant.pipeline.workbench import Workbench
from pliant.records.chain import ChainModel
from pliant.records.rollout import Equilibrium, Inputs
from pliant.registry.discovery import Registry, discover
from pliant.store.store import ArtifactStore, write_atomically

ROOT = Path(__file__).resolve().parents[1]
OUT = ROOT / "benchmarks" / "out"
REFERENCE = ROOT.parent / "shared" / "data" / "reference"
CPUINFO = Path("/proc/cpuinfo")
ROUNDING = 1e-9


@dataclass(frozen=True)
class Bar:
    """A figure to reach.

    Attributes:
        what: in words.
        reached: None: not run.
        bar: the limit, in the unit of `reached`.
        unit: that both are shown in, `scale` times their own.
        at_most: whether less is better.
        published: of the published study, in words; "" where it has none.
    """

    what: str
    reached: float | None
    bar: float
    unit: str
    at_most: bool = True
    scale: float = 1.0
    published: str = ""

    @property
    def met(self) -> bool | None:
        """None where it was not run."""
        if self.reached is None:
            return None
        slack = ROUNDING * max(abs(self.bar), ROUNDING)
        return bool(self.reached <= self.bar + slack if self.at_most else self.reached >= self.bar - slack)

    def shown(self, value: float | None) -> str:
        """A number with its unit."""
        return "not run" if value is None else f"{self.scale * value:.3g} {self.unit}".strip()

    def __str__(self) -> str:
        word = "at most" if self.at_most else "at least"
        verdict = {None: "", True: ": met", False: ": MISSED"}[self.met]
        return f"bar: {self.what}: {self.shown(self.reached)} ({word} {self.shown(self.bar)}){verdict}"

    def json(self) -> dict[str, Any]:
        """As a result keeps it."""
        return {**asdict(self), "met": self.met}

    @staticmethod
    def of(kept: Mapping[str, Any]) -> Bar:
        """The bar that a result keeps."""
        return Bar(**{name: value for name, value in kept.items() if name != "met"})


def parser_of(doc: str | None, quick: str = "") -> argparse.ArgumentParser:
    """A parser that shows a module's docstring as it stands; `quick` explains --quick where there is one."""
    parser = argparse.ArgumentParser(
        description=doc, formatter_class=argparse.RawDescriptionHelpFormatter, allow_abbrev=False
    )
    if quick:
        parser.add_argument("--quick", action="store_true", help=quick)
    return parser


@cache
def registry() -> Registry:
    """The installed plugins."""
    return discover()


def workbench() -> Workbench:
    """With the store of this checkout."""
    return Workbench(registry(), ArtifactStore(ROOT / ".pliant" / "store"))


def component(interface: str, kind: str, **settings: Any) -> Any:
    """A plugin's component with some settings, keys as in a study."""
    found = registry().get(interface, kind)
    return found.build(found.config_model().model_validate({"kind": kind, **settings}))


def engine(kind: str, **settings: Any) -> PhysicsBackend:
    """An engine: quasistatic, mujoco, pybullet."""
    return component("physics", kind, **settings)


def known(kind: str) -> bool:
    """Whether an engine is installed; says so where it is not."""
    try:
        engine(kind)
    except MissingDependencyError as error:
        print(f"{kind} skipped: {error}")
        return False
    return True


def settle(backend: PhysicsBackend, chain: ChainModel, inputs: Inputs) -> tuple[Equilibrium, float]:
    """The equilibrium from the straight chain, and CPU seconds of `apply` and `settle`."""
    with backend.build(chain) as simulation:
        begun = time.process_time()
        simulation.apply(inputs)
        end = simulation.settle()
        return end, time.process_time() - begun


def largest_mm(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    """Largest distance of a marker in one pose (n, 3), m, from its place in another."""
    return 1e3 * float(np.linalg.norm(one - other, axis=-1).max())


def ratio(baseline: Sequence[float], other: Sequence[float]) -> float:
    """Median over common rounds of baseline / other: load of the machine hits both alike."""
    return statistics.median(slow / fast for slow, fast in zip(baseline, other, strict=False))


def seconds_of(
    work: Callable[[], object], rounds: int = 1, clock: Callable[[], float] = time.process_time
) -> list[float]:
    """Seconds of each of some calls, by default of this process's processor time."""
    times = []
    for _ in range(rounds):
        begun = clock()
        work()
        times.append(clock() - begun)
    return times


def machine() -> dict[str, Any]:
    """Processor, cores, versions, and how busy the machine was in the last minute (processes that wait or run)."""
    return {
        "processor": processor(),
        "cores": os.cpu_count(),
        "system": f"{platform.system()} {platform.release()}",
        "python": platform.python_version(),
        "numpy": np.__version__,
        "load": os.getloadavg()[0] if hasattr(os, "getloadavg") else None,
    }


def processor() -> str:
    """The processor's name, as far as the system tells it."""
    try:
        lines = CPUINFO.read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    names = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(names, "") or platform.processor() or platform.machine()


def write(name: str, results: Mapping[str, Any], bars: Sequence[Bar] = ()) -> None:
    """Print the bars; benchmarks/out/NAME.json: results, bars, and the machine that they were measured on."""
    for bar in bars:
        print(bar)
    document = {**results, "bars": [bar.json() for bar in bars], "machine": machine()}
    OUT.mkdir(parents=True, exist_ok=True)
    write_atomically(OUT / f"{name}.json", json.dumps(document, indent=1, default=float))


def read(name: str) -> dict[str, Any]:
    """What an earlier run wrote, or nothing."""
    try:
        found: dict[str, Any] = json.loads((OUT / f"{name}.json").read_text())
    except (OSError, ValueError):
        return {}
    return found


def reference_table(name: str) -> dict[str, NDArray[np.float64]] | None:
    """Columns (n,) of a CSV of the published study by name; None where the folder is absent."""
    path = REFERENCE / name
    if not path.is_file():
        return None
    rows = np.genfromtxt(path, delimiter=",", names=True)
    return {column: np.asarray(rows[column], float) for column in rows.dtype.names or ()}
