"""Every public name of `import pliant` has an example in its docstring, and it does what stands there."""

import doctest
import inspect
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from tests.notebook.test_study import STUDY

import pliant
from pliant.notebook import result, study

pytest.importorskip("pandas")
EXAMPLES = Path(__file__).parents[2] / "examples"
SLOW = ("fem", "diagnose", "improve", "extend", "optimize")
FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


def documented() -> dict[str, object]:
    """The functions of the package's door, and the public methods and properties of what they give."""
    found: dict[str, object] = {name: getattr(pliant, name) for name in pliant.__all__}
    for owner in (study.StudyHandle, study.Simulated, study.Fitted, result.Result):
        for name, member in vars(owner).items():
            if not name.startswith("_") and (inspect.isfunction(member) or isinstance(member, property)):
                found[f"{owner.__name__}.{name}"] = member
    return found


NAMES = [name for name in documented() if name not in ("StudyHandle.config", "StudyHandle.name")]


@pytest.fixture(scope="module")
def names(tmp_path_factory: pytest.TempPathFactory, shared_store: Path) -> dict[str, object]:
    """What the examples may speak of: a stated finger, the joint of the hidden effect, the folder of the examples."""
    matplotlib.use("Agg")
    folder = tmp_path_factory.mktemp("docstrings")
    (folder / "study.yaml").write_text(STUDY)
    return {
        "np": np,
        "pliant": pliant,
        "examples": EXAMPLES,
        "store": shared_store,
        "finger": pliant.open(folder / "study.yaml", store=shared_store),
        "joint": pliant.open(EXAMPLES / "hidden_effect" / "finger.yaml", store=shared_store),
    }


@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=[pytest.mark.slow] if n.rpartition(".")[2] in SLOW else []) for n in NAMES],
)
def test_the_example_of_a_public_name_holds(name: str, names: dict[str, object]) -> None:
    text = inspect.getdoc(documented()[name]) or ""
    test = doctest.DocTestParser().get_doctest(text, dict(names), name, None, 0)
    assert test.examples, f"{name} has no example"
    printed: list[str] = []
    outcome = doctest.DocTestRunner(optionflags=FLAGS).run(test, out=printed.append)
    assert outcome.failed == 0, "".join(printed)
    matplotlib.pyplot.close("all")
