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
from pliant.pipeline.workbench import RunContext
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
        """Return whether the bar is met; None if it was not run."""
        if self.reached is None:
            return None
        slack = ROUNDING * max(abs(self.bar), ROUNDING)
        return bool(self.reached <= self.bar + slack if self.at_most else self.reached >= self.bar - slack)

    def shown(self, value: float | None) -> str:
        """Return a number with its unit."""
        return "not run" if value is None else f"{self.scale * value:.3g} {self.unit}".strip()

    def __str__(self) -> str:
        word = "at most" if self.at_most else "at least"
        verdict = {None: "", True: ": met", False: ": MISSED"}[self.met]
        return f"bar: {self.what}: {self.shown(self.reached)} ({word} {self.shown(self.bar)}){verdict}"

    def json(self) -> dict[str, Any]:
        """Return the bar as stored in a result."""
        return {**asdict(self), "met": self.met}

    @staticmethod
    def from_result(kept: Mapping[str, Any]) -> Bar:
        """Return the bar stored in a result."""
        return Bar(**{name: value for name, value in kept.items() if name != "met"})


def make_parser(doc: str | None, quick: str = "") -> argparse.ArgumentParser:
    """Return a parser that shows a module's docstring verbatim; `quick` is the help of --quick, if it exists."""
    parser = argparse.ArgumentParser(
        description=doc, formatter_class=argparse.RawDescriptionHelpFormatter, allow_abbrev=False
    )
    if quick:
        parser.add_argument("--quick", action="store_true", help=quick)
    return parser


@cache
def registry() -> Registry:
    """Return the installed plugins."""
    return discover()


def workbench() -> RunContext:
    """Return the run context with the store of this checkout."""
    return RunContext(registry(), ArtifactStore(ROOT / ".pliant" / "store"))


def component(interface: str, kind: str, **settings: Any) -> Any:
    """Return a plugin's component with some settings, keys as in a study."""
    found = registry().get(interface, kind)
    return found.build(found.config_model().model_validate({"kind": kind, **settings}))


def engine(kind: str, **settings: Any) -> PhysicsBackend:
    """Return an engine: quasistatic, mujoco, pybullet."""
    return component("physics", kind, **settings)


def known(kind: str) -> bool:
    """Return whether an engine is installed; print a message if it is not."""
    try:
        engine(kind)
    except MissingDependencyError as error:
        print(f"{kind} skipped: {error}")
        return False
    return True


def settle(backend: PhysicsBackend, chain: ChainModel, inputs: Inputs) -> tuple[Equilibrium, float]:
    """Settle from the straight chain; return the equilibrium and CPU seconds of `apply` and `settle`."""
    with backend.build(chain) as simulation:
        begun = time.process_time()
        simulation.apply(inputs)
        end = simulation.settle()
        return end, time.process_time() - begun


def largest_mm(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    """Return the largest distance of a marker between two poses (n, 3), in m."""
    return 1e3 * float(np.linalg.norm(one - other, axis=-1).max())


def ratio(baseline: Sequence[float], other: Sequence[float]) -> float:
    """Return the median over common rounds of baseline / other, robust to the load of the machine."""
    return statistics.median(slow / fast for slow, fast in zip(baseline, other, strict=False))


def time_calls(
    work: Callable[[], object], rounds: int = 1, clock: Callable[[], float] = time.process_time
) -> list[float]:
    """Return seconds of each of some calls, by default of this process's processor time."""
    times = []
    for _ in range(rounds):
        begun = clock()
        work()
        times.append(clock() - begun)
    return times


def machine() -> dict[str, Any]:
    """Return processor, cores, versions, and load of the last minute (processes that wait or run)."""
    return {
        "processor": processor(),
        "cores": os.cpu_count(),
        "system": f"{platform.system()} {platform.release()}",
        "python": platform.python_version(),
        "numpy": np.__version__,
        "load": os.getloadavg()[0] if hasattr(os, "getloadavg") else None,
    }


def processor() -> str:
    """Return the processor's name, as far as the system provides it."""
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
    """Return the result of an earlier run, or an empty dict."""
    try:
        found: dict[str, Any] = json.loads((OUT / f"{name}.json").read_text())
    except (OSError, ValueError):
        return {}
    return found


def reference_table(name: str) -> dict[str, NDArray[np.float64]] | None:
    """Return columns (n,) of a CSV of the published study by name; None without the folder."""
    path = REFERENCE / name
    if not path.is_file():
        return None
    rows = np.genfromtxt(path, delimiter=",", names=True)
    return {column: np.asarray(rows[column], float) for column in rows.dtype.names or ()}
