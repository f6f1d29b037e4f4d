"""Settings of all tests, and FEM states for tests that need some but do not test the FEM."""

import csv
import gc
import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings
from tests.pixels import as_needed

# Derandomised examples without a deadline: a loaded machine must not fail a test.
settings.register_profile(
    "pliant", derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("pliant")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Run files with slow tests first, before the fast suite drops these, since their other tests take long too.

    This keeps two workers evenly loaded at the end.
    """
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: item.path not in slow)


def pytest_collection_finish() -> None:
    """Collect garbage less often and never among objects already loaded, which took a tenth of the suite's time."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(2000, 20, 50)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Run a test including its fixtures and those of its module."""
    with as_needed(item):
        return (yield)


@pytest.fixture(scope="session")
def fem_states() -> list[dict[str, float]]:
    """Return solved states of the first finger's module, SI; `solve_fem_states.py` writes them."""
    table = Path(__file__).parent / "data" / "fem_states.csv"
    with table.open(encoding="utf-8", newline="") as file:
        return [{name: float(value) for name, value in row.items()} for row in csv.DictReader(file)]


@pytest.fixture(scope="session")
def shared_store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return one store for tests that fit the same meta-model, so that all workers together fit it once."""
    place = tmp_path_factory.getbasetemp()
    return (place.parent if "PYTEST_XDIST_WORKER" in os.environ else place) / "shared_store"
