"""The co-design study small enough for CI: two of its tasks, only the variables that belong to a task.

What a search finds out about its winner afterwards costs grasps for every variable and task; so there are few of both.
"""

from __future__ import annotations

import json
from pathlib import Path

from pliant import api


def few(file: Path, store: Path) -> tuple[str, ...]:
    """Changes that leave of a study its first and last task, and the variables with `only`.

    Args:
        file: the study; it has conditions and such variables.
        store: of the workbench; nothing is written.
    """
    search = api.open_study(file, store=store).study.need("search", "a small study")
    variables = {
        name: one.model_dump(mode="json", exclude_unset=True) for name, one in search.variables.items()
    }
    kept = {name: one for name, one in variables.items() if one.get("only")}
    tasks = list(search.conditions)
    ends = {name: search.conditions[name] for name in (tasks[0], tasks[-1])}
    return (
        f"search.variables={json.dumps(kept)}",
        f"search.conditions={json.dumps(ends)}",
        "search.constraints=[]",  # they name the others
    )
