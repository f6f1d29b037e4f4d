"""A faster crawler than the hand-made one, found by two optimizers and verified by direct FEM in two engines.

python -m benchmarks.tasks.crawl    prints a table, and writes benchmarks/out/crawl.json and crawl_OPTIMIZER/

It runs `pliant optimize examples/crawl/search.yaml` with each optimizer, 80 candidates each: three minutes of one core.
Stored results are reused. The hand-made crawler is that of examples/crawl/crawler.yaml.
"""

from __future__ import annotations

import json
import subprocess
import sys
from typing import Any

from benchmarks.output import OUT, ROOT, Bar, make_parser, registry, workbench, write

from pliant.config.loading import load_study
from pliant.interfaces.effect import Model
from pliant.pipeline.simulate import scene_engine
from pliant.pipeline.study import build_study_chain

EXAMPLE = ROOT / "examples" / "crawl"
OPTIMIZERS = ("cmaes", "optuna")
GAIN = 0.2
COLUMNS = "{:<12}{:>10}{:>12}{:>12}{:>12}{:>7}{:>12}{:>9}"


def main() -> None:
    """Run both searches and compare what they found with the hand-made crawler."""
    make_parser(__doc__).parse_args()
    found: dict[str, Any] = {name: _searched(name) for name in OPTIMIZERS}
    hand = _hand_made()
    print(COLUMNS.format("", "predicted", *hand, "least gain", "cost", "law, worst", "wall"))
    speeds = [f"{1e3 * one['speed_m_s']:.2f} mm/s" for one in hand.values()]
    cost = f"{next(iter(hand.values()))['cost_of_transport_ratio']:.2f}"
    print(COLUMNS.format("hand-made", "", *speeds, "", cost, "", ""))
    bars = []
    for name, result in found.items():
        verified = result["verified"]
        engines = verified["engines"]
        gain = min(engines[k]["speed_m_s"] / one["speed_m_s"] - 1.0 for k, one in hand.items())
        speeds = [f"{1e3 * engines[kind]['speed_m_s']:.2f} mm/s" for kind in hand]
        law = max(one["worst_of_range"] for one in verified["laws"])
        predicted, cost = f"{1e3 * result['objective']:.2f}", f"{verified['cost_of_transport_ratio']:.2f}"
        wall = f"{result['wall_s']:.0f} s"
        print(COLUMNS.format(name, predicted, *speeds, f"{gain:.0%}", cost, f"{law:.2%}", wall))
        bars.append(Bar(f"{name}: verified speed over the hand-made one", gain, GAIN, "%", False, 100))
    write("crawl", {"hand_made": hand, **found}, bars)


def _searched(optimizer: str) -> dict[str, Any]:
    """Return the JSON result of a search."""
    folder = OUT / f"crawl_{optimizer}"
    command = ["optimize", str(EXAMPLE / "search.yaml"), f"optimizer.kind={optimizer}", "--out", str(folder)]
    subprocess.run([sys.executable, "-m", "pliant", *command], cwd=ROOT, check=True)
    result: dict[str, Any] = json.loads((folder / "optimize.json").read_text(encoding="utf-8"))
    return result


def _hand_made() -> dict[str, dict[str, float]]:
    """Return the metrics of the hand-made crawler in each engine."""
    study = load_study(EXAMPLE / "crawler.yaml", registry())
    chain = build_study_chain(workbench(), study).chain
    assert study.task is not None
    task = workbench().build("task", study.task)
    found = {}
    for config in filter(None, (study.physics, *study.cross_check)):
        backend = workbench().build("physics", config)
        metrics = task.run(chain, scene_engine(backend, Model(chain))).metrics
        found[config.kind] = {name: v for name, v in metrics.items() if isinstance(v, float)}
    return found


if __name__ == "__main__":
    main()
