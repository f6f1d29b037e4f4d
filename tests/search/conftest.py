"""The small study of `tests.cli.search_study`, searched by the optimizers of `toy_search`."""

from dataclasses import replace
from pathlib import Path

import pytest
from tests.cli.search_study import STUDY

from pliant import api

PLUGIN = Path(__file__).with_name("narrowing_plugin.py")


@pytest.fixture
def opened(tmp_path):
    """Return a function that opens the study; `change` replaces a text of its file, `progress` receives reports."""
    path = tmp_path / "study.yaml"
    text = STUDY.replace("{kind: cmaes}", "{kind: narrowing}") + f"plugins: [{PLUGIN}]\n"

    def call(*overrides, store="store", change=("", ""), progress=None):
        path.write_text(text.replace(*change))
        study = api.open_study(path, overrides, store=tmp_path / store)
        return (
            study if progress is None else replace(study, context=replace(study.context, progress=progress))
        )

    return call


@pytest.fixture
def optimized(opened):
    """Return a function that gives the result of the study's search, in this process."""
    return lambda *overrides, workers=1, **how: api.optimize(opened(*overrides, **how), workers=workers)
