"""Labels and answers as the judge of the testbed reads them."""

from __future__ import annotations

from typing import Any

from benchmarks.evidence.judge import judge
from benchmarks.evidence.truths import right_verdicts, right_where_the_law_is_off

CLASSES = [["actuation_gain", "stiffness", "wall_thickness"]]


def make_label(kind: str, law_error: float = 0.0) -> dict[str, Any]:
    label = {
        "kind": kind,
        "forms": ["a form"],
        "engine": "functional",
        "robot": "joint",
        "protocol": "rich",
        "excited": True,
    }
    right = right_where_the_law_is_off(kind) if law_error else right_verdicts(kind)
    return label | {"right": list(right), "snr_reached": 2.0, "law_error": law_error}


def answer(verdict: str, *selected: str, credible: Any = ()) -> dict[str, Any]:
    sets = [{"kinds": kinds} for kinds in credible]
    return {"result": {"verdict": verdict, "selected": list(selected), "credible_set": sets}, "wall_s": 1.0}


def stated(probability: float, right: bool) -> Any:
    line = answer("missing_effect", "mullins" if right else "stiffness")
    line["result"]["hypotheses"] = [
        {"kinds": ["mullins" if right else "stiffness"], "probability": probability},
        {"kinds": [], "probability": 1 - probability},
    ]
    return judge("effect", make_label("mullins"), line)
