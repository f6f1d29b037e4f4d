"""The notebooks of examples/notebooks, run cell by cell as in Jupyter: the last expression of a cell is shown."""

import ast
import json
from pathlib import Path
from typing import Any

import matplotlib
import pytest

NOTEBOOKS = Path(__file__).parents[2] / "examples" / "notebooks"
pytest.importorskip("pandas")


def executed(name: str, monkeypatch: pytest.MonkeyPatch, store: Path) -> tuple[dict[str, Any], list[Any]]:
    """Return the names and the shown values of a notebook, run in its own folder with the store elsewhere."""
    matplotlib.use("Agg")
    monkeypatch.chdir(NOTEBOOKS)
    monkeypatch.setattr("pliant.notebook.session.open_study.__kwdefaults__", {"store": store})
    names: dict[str, Any] = {}
    shown = []
    for cell in json.loads((NOTEBOOKS / f"{name}.ipynb").read_text(encoding="utf-8"))["cells"]:
        if cell["cell_type"] != "code":
            continue
        assert not cell["outputs"], "outputs do not belong into the tree"
        text = "".join(cell["source"])
        tree = ast.parse(text)
        last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
        exec(compile(tree, name, "exec"), names)
        if last is not None:
            value = eval(compile(ast.Expression(last.value), name, "eval"), names)  # type: ignore[attr-defined]
            shown.append(value)
            for way in ("_repr_html_", "__repr__"):
                if hasattr(value, way):
                    assert getattr(value, way)()
    matplotlib.pyplot.close("all")
    return names, shown


def test_first_finger(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    names, _ = executed("first_finger", monkeypatch, tmp_path)
    assert names["bent"].converged
    assert names["bent"].tip[0] > names["settled"].tip[0] > 0


@pytest.mark.slow
def test_my_csv(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    names, _ = executed("my_csv", monkeypatch, tmp_path)
    assert names["found"].verdict == "missing_effect"
    assert names["better"].steps[-1].locked.over_floor < 1.2 < names["better"].steps[0].locked.over_floor


@pytest.mark.slow
def test_design_search(monkeypatch: pytest.MonkeyPatch, shared_store: Path) -> None:
    names, _ = executed("design_search", monkeypatch, shared_store)
    assert names["history"].shape[0] == 30
    assert names["best"].objectives["rmse"] == pytest.approx(
        names["history"].loc[names["history"]["status"] == "ok", "rmse"].min()
    )


def test_my_own_effect_and_family(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    names, shown = executed("my_own_effect_and_family", monkeypatch, tmp_path)
    assert 0.5 < next(value for value in shown if isinstance(value, float)) < 1.0
    assert list((names["folder"] / "my-module").rglob("manifest.py"))
