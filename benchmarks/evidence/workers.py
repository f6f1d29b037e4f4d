"""Work on one set: make it and further runs, with the key; or diagnose it, without the key, in a separate process."""

from __future__ import annotations

import hashlib
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.evidence import diagnosers, seal
from benchmarks.evidence.tasks import Task

from pliant.store.store import write_atomically

KEPT = {"verdict", "selected", "selected_class", "beside_class", "hypotheses", "credible_set", "classes"}
KEPT |= {"n_effective", "next_experiment", "steps", "bookkeeping"}
# Of a hypothesis the judge needs no more, and of its parameters.
HYPOTHESIS = ("kinds", "probability", "rmse_over_floor", "parameters")
PARAMETER = ("value", "sd", "low", "high")
# Its sets are also given to the scorer with the true forms.
ORACLE_GROUP = "poor"
# Any run of the menu, drawn at random.
ANY = "*"


def make(task: Task, name: str, folder: Path, key: bytes) -> None:
    """Write NAME.csv, NAME_study.yaml and NAME.sealed, unless they exist."""
    from benchmarks.evidence.sets import make_set

    sealed = folder / f"{name}{seal.SUFFIX}"
    if sealed.exists():  # written last, so the set is complete
        return
    folder.mkdir(parents=True, exist_ok=True)
    made = make_set(task.spec, name=f"set-{name}")
    label = dict(made.label)
    if task.group == ORACLE_GROUP:
        from benchmarks.evidence.oracle import mean_squares

        label["mean_squares"] = mean_squares(task.spec, made)
    write_atomically(folder / f"{name}.csv", made.csv)
    write_atomically(folder / f"{name}_study.yaml", made.study)
    write_atomically(sealed, seal.seal(label, key))


def add_runs(task: Task, name: str, folder: Path, chosen: Sequence[str]) -> list[str]:
    """Make the runs of these names (`ANY`: drawn) with the set's truth, as NAME_added.csv.

    Returns their names. Runs that are drawn differ from each other.
    """
    from benchmarks.evidence.sets import added_csv, make_set

    from pliant import api
    from pliant.experiments.experiment_catalogue import timed_catalogue
    from pliant.experiments.planned_run import BenchScale

    with tempfile.TemporaryDirectory() as store:
        opened = api.open_study(folder / f"{name}_study.yaml", store=Path(store))
        model = api.predictor(opened, folder / f"{name}.csv")
        runs = timed_catalogue(BenchScale.from_measurement(model.chain, model.measurement))
    rng = np.random.default_rng(_seed(name))
    order = iter(rng.permutation(len(runs)))
    named = {run.name: run for run in runs}
    taken = [runs[next(order)] if one == ANY else named[one] for one in chosen]
    write_atomically(folder / f"{name}_added.csv", added_csv(task.spec, make_set(task.spec), taken))
    return [run.name for run in taken]


@dataclass(frozen=True)
class Question:
    """The input of a diagnoser's process: only paths of a study and of CSVs by the set's name.

    Attributes:
        verb: `diagnose` or `improve`, a function of the `module`.
        added: the set has further runs.
    """

    verb: str
    module: str
    name: str
    folder: Path
    added: bool = False


def ask(question: Question) -> dict[str, Any]:
    """Diagnose one set in a diagnoser's process; return its line of results."""
    name, path = question.name, str(question.folder / question.name)
    data = [f"{path}.csv", *([f"{path}_added.csv"] if question.added else [])]
    start, cpu = time.perf_counter(), time.process_time()
    line: dict[str, Any] = {"id": name, "verb": question.verb}
    try:
        diagnoser = diagnosers.load(question.module, question.verb)
        result = diagnoser(f"{path}_study.yaml", data, _seed(name))
        line["result"] = {key: value for key, value in result.items() if key in KEPT}
        if "hypotheses" in result:
            line["result"]["hypotheses"] = [_needed(one) for one in result["hypotheses"]]
    except Exception as error:  # one set that fails must not end the bench
        line["error"] = f"{type(error).__name__}: {error}"[:2000]
    return line | {"wall_s": time.perf_counter() - start, "cpu_s": time.process_time() - cpu}


def _needed(hypothesis: Mapping[str, Any]) -> dict[str, Any]:
    kept = {key: hypothesis[key] for key in HYPOTHESIS if key in hypothesis}
    if "parameters" in kept:
        kept["parameters"] = {
            name: {key: one[key] for key in PARAMETER if key in one}
            for name, one in (kept["parameters"] or {}).items()
        }
    return kept


def _seed(name: str) -> int:
    return int.from_bytes(hashlib.sha256(name.encode()).digest()[:4])
