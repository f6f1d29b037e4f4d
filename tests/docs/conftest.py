"""A working folder for the commands of a page."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from tests.docs.pages import ROOT


@pytest.fixture(scope="module")
def workplace(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Return the working folder of a module's tests, with the examples in it and one store for all of them."""
    folder = tmp_path_factory.mktemp("typed")
    (folder / "examples").symlink_to(ROOT / "examples")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setenv("PLIANT_STORE", str(folder / "store"))
        yield folder
