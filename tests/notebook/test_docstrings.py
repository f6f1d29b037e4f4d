"""Every public name of `import pliant` has an example in its docstring, and the example gives the stated result."""

import doctest
import inspect
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from tests.notebook.test_study import STUDY

import pliant
from pliant.notebook import compose, result, study
from pliant_plugins.families.reference import FINGER
from pliant_plugins.manifest import STUDY_LAW

pytest.importorskip("pandas")
LAW = {"kind": "polynomial", "form": "study", "odd": True, "coefficients": STUDY_LAW}
EXAMPLES = Path(__file__).parents[2] / "examples"
SLOW = ("fem", "solve", "diagnose", "improve", "extend", "optimize")
FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


def documented() -> dict[str, object]:
    """Return the public functions of the package, and the public methods and properties of their results."""
    found: dict[str, object] = {name: getattr(pliant, name) for name in pliant.__all__}
    for owner in (
        study.StudyHandle,
        study.Simulated,
        study.Fitted,
        result.Result,
        compose.ComposedStudy,
        pliant.Chain,
    ):
        for name, member in vars(owner).items():
            shown = inspect.isfunction(member) or isinstance(member, property | classmethod)
            if not name.startswith("_") and shown:
                found[f"{owner.__name__}.{name}"] = member
    return found


NAMES = [name for name in documented() if name not in ("StudyHandle.config", "StudyHandle.name")]


@pytest.fixture(scope="module")
def names(tmp_path_factory: pytest.TempPathFactory, shared_store: Path) -> dict[str, object]:
    """Return names for the examples: a stated finger, the joint of the hidden effect, the folder of the examples."""
    matplotlib.use("Agg")
    folder = tmp_path_factory.mktemp("docstrings")
    (folder / "study.yaml").write_text(STUDY)
    return {
        "np": np,
        "pliant": pliant,
        "examples": EXAMPLES,
        "store": shared_store,
        "finger": pliant.open(folder / "study.yaml", store=shared_store),
        "LAW": LAW,
        "FINGER": {"kind": "bellow_bending", **FINGER},
        "chain": pliant.Chain.from_modules(LAW, 8, module_length="11 mm", store=shared_store),
        "joint": pliant.open(EXAMPLES / "hidden_effect" / "finger.yaml", store=shared_store),
    }


@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=[pytest.mark.slow] if n.rpartition(".")[2] in SLOW else []) for n in NAMES],
)
def test_the_example_for_a_public_name_holds(name: str, names: dict[str, object]) -> None:
    text = inspect.getdoc(documented()[name]) or ""
    test = doctest.DocTestParser().get_doctest(text, dict(names), name, None, 0)
    assert test.examples, f"{name} has no example"
    printed: list[str] = []
    outcome = doctest.DocTestRunner(optionflags=FLAGS).run(test, out=printed.append)
    assert outcome.failed == 0, "".join(printed)
    matplotlib.pyplot.close("all")
