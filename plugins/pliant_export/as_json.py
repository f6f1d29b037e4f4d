"""A law as JSON, and a reader of it in ten lines."""

from __future__ import annotations

import json
import math
from typing import Any

from pliant_export.tape import INPUT, NUMBER
from pliant_export.written_law import LEVEL, WrittenLaw

READER = '''"""Laws that Pliant wrote as JSON: outputs(read("x_law.json"), pressure, angle) has tau and its slopes."""
import json, math, operator as op

DO = {"+": op.add, "-": op.sub, "*": op.mul, "/": op.truediv, "<": op.lt, "<=": op.le, ">": op.gt, ">=": op.ge,
      "==": op.eq, "!=": op.ne, "and": op.and_, "or": op.or_, "not": op.not_, "min": min, "max": max, "abs": abs,
      "?": lambda test, yes, no: yes if test else no, **vars(math)}
def read(path): return json.load(open(path, encoding="utf-8"))
def outputs(law, *inputs):
    v, get = [], {"input": inputs.__getitem__, "number": float, "take": lambda k: law["table"][int(v[k])]}
    for name, *k in law["steps"]: v.append(get[name](k[0]) if name in get else DO[name](*(v[i] for i in k)))
    return {name: [v[i] for i in places] for name, places in law["outputs"].items()}
'''


def as_dict(law: WrittenLaw) -> dict[str, Any]:
    """Return the law as a JSON object; missing limits are null."""
    steps: list[list[Any]] = []
    for step in law.tape.steps:
        if step.name == INPUT:
            steps.append([INPUT, int(step.number)])
        elif step.name == NUMBER:
            steps.append([NUMBER, step.number])
        else:
            steps.append([step.name, *step.arguments])
    return {
        "law": law.name,
        "about": list(law.about),
        "inputs": [*law.actuations, *law.deformations],
        "unit_of_tau": law.unit,
        "domain": [[_limit(value) for value in row] for row in law.domain.tolist()],
        "band": None if law.band is None else {"level": LEVEL, "half_width": law.band.tolist()},
        "steps": steps,
        "outputs": {name: list(places) for name, places in law.tape.outputs.items()},
        "table": law.tape.table.tolist(),
    }


def as_json(law: WrittenLaw) -> str:
    """Return the text of the file."""
    whole = as_dict(law)
    steps = whole.pop("steps")
    head = json.dumps(whole, indent=1)[:-2]
    rows = ",\n".join("  " + json.dumps(step) for step in steps)
    return f'{head},\n "steps": [\n{rows}\n ]\n}}\n'


def _limit(value: float) -> float | None:
    return value if math.isfinite(value) else None
