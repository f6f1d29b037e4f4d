"""The co-design study small enough for CI: two of its tasks, only the variables that belong to a task.

What a search finds out about its winner afterwards costs grasps for every variable and task; so there are few of both.
"""

from __future__ import annotations

from pliant.config.study import Study


def few(study: Study) -> Study:
    """The study with its first and last task, and the variables with `only`; constraints, which name others, go."""
    search = study.need("search", "a small study")
    tasks = list(search.conditions)
    changes = {
        "variables": {name: one for name, one in search.variables.items() if one.only},
        "conditions": {name: search.conditions[name] for name in (tasks[0], tasks[-1])},
        "constraints": (),
    }
    small: Study = study.model_copy(update={"search": search.model_copy(update=changes)})
    return small
