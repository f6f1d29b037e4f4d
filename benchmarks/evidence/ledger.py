"""Sealed runs: the code of the diagnosis is fixed by its digest, and the judged sets are drawn from that digest.

A change of the code draws other sets, so that no result can be quoted for other code than was measured. Every sealed
run leaves a line in `ledger.jsonl` when it begins and one when it ends or is stopped; lines are only added. The
answers of the latest run lie in `answers.jsonl.gz` with their opened labels: the page is made from them.
"""

from __future__ import annotations

import gzip
import json
import subprocess
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from benchmarks.evidence.judge import Judged, is_truth, judge, truth_fitted
from benchmarks.evidence.tasks import Task, digest
from benchmarks.output import ROOT

LEDGER = Path(__file__).parent / "ledger.jsonl"
ANSWERS = Path(__file__).parent / "answers.jsonl.gz"
# Of the latest sealed run of each bed.
ANSWERS_OF = {"exact": ANSWERS, "law_off": ANSWERS.with_name("answers_law_off.jsonl.gz")}
# Code that determines a diagnosis.
CODE = (
    "core/pliant/diagnosis",
    "core/pliant/evidence",
    "core/pliant/measurements",
    "core/pliant/least_squares.py",
    "core/pliant/interfaces",
    "core/pliant/records",
    "core/pliant/mechanics",
    "plugins/pliant_plugins/effects",
    "plugins/pliant_plugins/physics",
)
LABEL = (
    "kind",
    "forms",
    "seed",
    "engine",
    "robot",
    "protocol",
    "snr_reached",
    "excited",
    "right",
    "mean_squares",
    "law_error",
    "law_form",
    "law_snr",
    "parameters",
    "unknown",
)
STEP = ("added", "rmse_over_floor")
LEAST_PROBABILITY = 0.01


def code_digest(root: Path = ROOT, parts: Sequence[str] = CODE) -> str:
    """Return digest of the code of the diagnosis.

    Raises:
        FileNotFoundError: a part of it is not there.
    """
    files: list[Path] = []
    for name in parts:
        part = root / name
        found = [part] if part.is_file() else sorted(part.rglob("*.py"))
        if not found:
            raise FileNotFoundError(part)
        files += found
    return digest(files)


def commit(parts: Sequence[str] = CODE) -> str:
    """Return the commit of the checkout, with a + if the code of the diagnosis has changed since."""

    def said(*words: str) -> str:
        done = subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=False)
        return done.stdout.strip()

    return (said("rev-parse", "--short", "HEAD") or "unknown") + (
        "+" if said("status", "--porcelain", *parts) else ""
    )


def now() -> str:
    """Return the UTC time, to the second."""
    return datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def note(entry: Mapping[str, Any], path: Path = LEDGER) -> None:
    """Add a line to the ledger."""
    with path.open("a") as file:
        file.write(json.dumps(entry) + "\n")


def entries(path: Path = LEDGER) -> list[dict[str, Any]]:
    """Return the runs in the order of their start; killed ones have no `ended`."""
    runs: dict[str, dict[str, Any]] = {}
    for line in path.read_text().splitlines() if path.exists() else ():
        one = json.loads(line)
        runs.setdefault(one["run"], {}).update(one)
    return list(runs.values())


def headline(data: Mapping[str, Any]) -> dict[str, list[int]]:
    """Return [count, total] of the figures in a ledger's line."""
    shares = {
        "strictly": data["effects"],
        "by_class": data["effects"]["by_class"],
        "wrong_kind": data["wrong_kind"],
        "false_alarms": data["false_alarms"],
        "unknown": data["unknown"],
        "pairs": data["pairs"],
        "pairs_by_class": data["pairs"]["by_class"],
    }
    return {name: [share["right"], share["n"]] for name, share in shares.items()}


def compact(task: Task, label: Mapping[str, Any], line: Mapping[str, Any]) -> dict[str, Any]:
    """Return one answer with its opened label in the stored form."""
    result = dict(line.get("result") or {})
    if result.get("hypotheses"):
        result["truth_fitted"] = truth_fitted(label, result)
        asked = label.get("parameters") or {}
        ranked = sorted(result["hypotheses"], key=lambda one: -one["probability"])
        kept_rank = [k for k, h in enumerate(ranked) if not k or h["probability"] >= LEAST_PROBABILITY]
        kept_rank += [k for k, h in enumerate(ranked) if asked and k not in kept_rank and is_truth(label, h)]
        result["hypotheses"] = [_without_parameters(label, ranked[k]) for k in kept_rank]
    if "steps" in result:
        result["steps"] = [{k: s[k] for k in STEP if k in s} for s in result["steps"] or ()]
    if "credible_set" in result:
        sets = result["credible_set"] or ()
        result["credible_set"] = [one["kinds"] if isinstance(one, dict) else one for one in sets]
    if "classes" in result:
        result["classes"] = [{"kinds": one["kinds"]} for one in result["classes"] or ()]
    result.pop("next_experiment", None)
    if "bookkeeping" in result:
        result["bookkeeping"] = [{"kind": one["kind"]} for one in result["bookkeeping"] or ()]
    kept = {name: line[name] for name in ("error", "added", "wall_s", "cpu_s") if name in line}
    known = {name: label[name] for name in LABEL if name in label}
    named = {"task": task.public_id, "group": task.group, "mode": task.mode}
    return _rounded({**named, "label": known, "result": result, **kept})


def _without_parameters(label: Mapping[str, Any], hypothesis: Mapping[str, Any]) -> dict[str, Any]:
    """Return the hypothesis, with its parameters only if the label states their values."""
    if label.get("parameters") and is_truth(label, hypothesis):
        return dict(hypothesis)
    return {key: value for key, value in hypothesis.items() if key != "parameters"}


def _rounded(value: Any) -> Any:
    if isinstance(value, float):
        return float(f"{value:.5g}")
    if isinstance(value, dict):
        return {key: _rounded(one) for key, one in value.items()}
    return [_rounded(one) for one in value] if isinstance(value, list | tuple) else value


def write_answers(
    head: Mapping[str, Any], answers: Iterable[Mapping[str, Any]], path: Path = ANSWERS
) -> None:
    """Write the run's head and its answers, one a line; the same bytes for the same content."""
    text = "\n".join(json.dumps(one, separators=(",", ":")) for one in (head, *answers))
    path.write_bytes(gzip.compress(text.encode(), 9, mtime=0))


def stored_answers(code: str, path: Path) -> dict[str, dict[str, Any]]:
    """Return the stored answers of a run of this code by the `public_id` of their tasks; empty for other code."""
    if not path.exists():
        return {}
    head, *answers = (json.loads(line) for line in gzip.decompress(path.read_bytes()).splitlines())
    return {one["task"]: one for one in answers if "task" in one} if head["code"] == code else {}


def read_answers(path: Path = ANSWERS) -> tuple[dict[str, Any], list[Judged]]:
    """Return the head of the latest sealed run and its answers, judged again; empty if none has ended yet."""
    if not path.exists():
        return {}, []
    head, *answers = (json.loads(line) for line in gzip.decompress(path.read_bytes()).splitlines())
    return head, judged(answers)


def judged(answers: Sequence[Mapping[str, Any]]) -> list[Judged]:
    """Judge the answers by their labels; older ones lack whether the truth was fitted."""
    fitted = {"truth_fitted": None}
    lines = [{**one, "result": fitted | one["result"]} for one in answers]
    return [
        judge(one["group"], one["label"], line, one["mode"]) for one, line in zip(answers, lines, strict=True)
    ]
