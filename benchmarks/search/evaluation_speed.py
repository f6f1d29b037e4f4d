"""What one candidate of a search costs, part by part, and from how few levels a chain finds its equilibrium.

python -m benchmarks.search.evaluation_speed [--candidates 40] [--steps 300] [--robust]

Four segments of six helical bellows follow a helix; laws by the meta-model `regression` of examples/designs. Times are
those of the processor, one thread, and also in units of a reference kernel of the same run: a product of two matrices
of 400 × 400. Prints, and writes benchmarks/out/evaluation_speed.json.
"""

from __future__ import annotations

import json
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.output import ROOT, parser_of, seconds_of, write

from pliant import api
from pliant.pipeline.study import simulate_study
from pliant.search.evaluate.evaluator import Evaluator
from pliant.search.evaluate.scenarios import draw_scenarios
from pliant.search.problem.search_problem import SearchProblem

STUDY = """\
pliant: 1
name: evaluation-speed
family: {{kind: bellow_helical, inner_radius: 3 mm, average_radius: 6 mm, wall: 1.5 mm, module_length: 5 mm}}
material: {{kind: neo_hookean, shear_modulus: 240 kPa, density: 1150 kg/m^3}}
meta_model: {{kind: regression, folds: 2, data: {table}}}
chain:
  base: {{direction: [0.882948, 0, -0.469472]}}
  segments:
{segments}
physics: quasistatic
task: {{kind: follow_shape, pressure: 12 kPa, target: {{radius: 18 mm, height: 60 mm}}, alignment: roll}}
search:
  variables:
    pressure: {{key: task.pressure, low: 10 kPa, high: 15 kPa}}
    turn2: {{key: chain.segments.1.rotation, low: 0, high: 3}}
    turn3: {{key: chain.segments.2.rotation, low: 0, high: 3}}
    turn4: {{key: chain.segments.3.rotation, low: 0, high: 3}}
{designs}
  objective: rmse
  robust: {{samples: 16, measure: cvar, vary: {{task.pressure: 0.2 kPa}}}}
"""
SEGMENT = "    - {modules: 6, family: {average_radius: 6 mm, module_length: 5 mm}}"
DESIGN = """\
    R{k}: {{key: chain.segments.{i}.family.average_radius, low: 5 mm, high: 7 mm}}
    l{k}: {{key: chain.segments.{i}.family.module_length, low: 4 mm, high: 6 mm}}"""
FEW = (1, 2, 3, 5)
AGREES_M = 1e-6


class Clock:
    """Processor time by part of the work; a part within another counts in both."""

    def __init__(self) -> None:
        self.spent: dict[str, float] = defaultdict(float)

    def __call__(self, part: str, work: Callable[[], Any]) -> Any:
        """See `pliant.search.evaluate.fast_path.Timer`."""
        begun = time.process_time()
        try:
            return work()
        finally:
            self.spent[part] += time.process_time() - begun


def main() -> None:
    """Print and write the figures that are asked for."""
    parser = parser_of(__doc__)
    parser.add_argument("--candidates", type=int, default=40, help="candidates that are timed")
    parser.add_argument(
        "--steps", type=int, default=0, help="random designs that are settled from few levels"
    )
    parser.add_argument(
        "--robust", action="store_true", help="time a candidate in 16 scenarios with drawn laws"
    )
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        one, problem = opened(Path(folder))
        matrix = np.random.default_rng(0).random((400, 400))
        # One product of two matrices of 400 × 400, the fastest of twenty.
        results: dict[str, Any] = {"kernel_ms": 1e3 * min(seconds_of(lambda: matrix @ matrix, 20))}
        results["candidate"] = of_candidates(one, problem, asked.candidates)
        if asked.robust:
            results["robust"] = of_candidates(one, problem, 3, robust=True)
        if asked.steps:
            results["steps"] = few_steps(one, problem, asked.steps)
    for name in ("candidate", "robust"):
        if name in results:
            results[name]["in_kernels"] = results[name]["total_ms"] / results["kernel_ms"]
    print(json.dumps(results, indent=1))
    write("evaluation_speed", results)


def opened(folder: Path) -> tuple[api.OpenStudy, SearchProblem]:
    """The study and its search, in a store of its own."""
    designs = "\n".join(DESIGN.format(k=i + 1, i=i) for i in range(4))
    path = folder / "study.yaml"
    table, segments = ROOT / "examples/designs/helical_grid.csv", "\n".join([SEGMENT] * 4)
    path.write_text(STUDY.format(table=table, designs=designs, segments=segments))
    one = api.open_study(path, store=folder / "store")
    return one, SearchProblem.of(one.study, one.bench.registry)


def drawn(problem: SearchProblem, seed: int) -> dict[str, float]:
    """Random values of all variables."""
    random = np.random.default_rng(seed)
    return {v.name: float(random.uniform(v.variable.low, v.variable.high)) for v in problem.variables}


def of_candidates(
    one: api.OpenStudy, problem: SearchProblem, count: int, robust: bool = False
) -> dict[str, Any]:
    """A candidate part by part; alone also through the stages of `pliant simulate`, else in the study's scenarios."""
    clock, scenarios = Clock(), ()
    if robust:
        config = problem.config.robust
        assert config is not None
        scenarios = draw_scenarios(problem, one.bench.registry, config)
    evaluator = Evaluator(one.bench, problem, scenarios, clock)
    evaluator.evaluate(drawn(problem, 10_000))  # the meta-model, and compiled code
    clock.spent.clear()
    found: list[Any] = []
    (spent,) = seconds_of(lambda: found.extend(evaluator.evaluate(drawn(problem, k)) for k in range(count)))
    total = 1e3 * spent / count
    result = {"total_ms": total, "parts_ms": {name: 1e3 * s / count for name, s in clock.spent.items()}}
    if robust:
        return {**result, "status": [trial.state for trial in found]}
    through = min(count, 10)
    begun = time.process_time()
    for seed, trial in enumerate(found[:through]):
        run = simulate_study(one.bench, problem.apply(drawn(problem, seed), 0))
        told = run.engines[0].result
        assert told is not None
        if trial.state == "ok":
            assert abs(told.metrics["rmse_m"] - trial.metrics["rmse_m"]) < 1e-12
    store = 1e3 * (time.process_time() - begun) / through
    return {**result, "through_the_store_ms": store, "ratio": store / total}


def few_steps(one: api.OpenStudy, problem: SearchProblem, count: int) -> dict[str, Any]:
    """How often a chain that is taken up in few levels ends elsewhere than in eleven."""
    path = Evaluator(one.bench, problem).path
    counted: dict[str, dict[str, int]] = {str(n): defaultdict(int) for n in FEW}
    for seed in range(count):
        study = problem.apply(drawn(problem, seed), 0)
        tasks = {n: study.task.model_copy(update={"steps": n}) for n in (*FEW, 11)}
        ends = {n: tip(path.result(study.model_copy(update={"task": task}))) for n, task in tasks.items()}
        for n in FEW:
            counted[str(n)][compared(ends[n], ends[11])] += 1
    return {"designs": count, **counted}


def tip(result: Any) -> np.ndarray | None:
    """(3,) the tip, or None where the chain did not get there."""
    return None if result.not_reached or not result.final.converged else np.asarray(result.final.tip_m)


def compared(few: np.ndarray | None, many: np.ndarray | None) -> str:
    """How the ends of two ramps compare."""
    if few is None or many is None:
        return "both fail" if few is many else "few fail" if few is None else "many fail"
    return "same" if np.linalg.norm(few - many) < AGREES_M else "elsewhere"


if __name__ == "__main__":
    main()
