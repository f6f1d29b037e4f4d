"""Protocols for the tests of benches."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

from pliant_bench.bench import BenchProtocol, BenchSample
from pliant_bench.emulator import compile_emulator

PERIOD_S = 0.01


@pytest.fixture
def hill() -> Callable[..., BenchProtocol]:
    """Return a function that gives a triangle of pressure up to a level, sampled every 10 ms."""

    def protocol(level: float = 10e3, duration_s: float = 4.0, acceleration_s: float = 0.3) -> BenchProtocol:
        time_s = np.arange(round(duration_s / PERIOD_S) + 1) * PERIOD_S
        path = 0.5 - 0.5 * np.cos(2 * np.pi * time_s / duration_s)
        path[-1] = 0.0
        return BenchProtocol("hill", "up and down", time_s, {"pressure_pa": level * path})

    return protocol


@pytest.fixture
def unwatched() -> Callable[[BenchSample], None]:
    return lambda sample: None


def pressure(values: Sequence[float], period_s: float = PERIOD_S) -> BenchProtocol:
    """Return a protocol of one pressure."""
    return BenchProtocol(
        "raw", "a raw path", np.arange(len(values)) * period_s, {"pressure_pa": np.array(values, float)}
    )


@pytest.fixture(scope="session")
def emulator_program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the emulated microcontroller, compiled."""
    if shutil.which("cc") is None:
        pytest.skip("no C compiler")
    return compile_emulator(tmp_path_factory.mktemp("emulator"))
