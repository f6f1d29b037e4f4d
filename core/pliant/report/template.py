"""The page's template; the code fingerprint of this room holds it, as a data file beside the code."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from typing import Any

NAME = "report.html.j2"


@cache
def page_template() -> Any:
    """The compiled template; every value is escaped."""
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.FunctionLoader(_source),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(NAME)


def _source(name: str) -> str:
    return (files("pliant.report") / "templates" / name).read_text(encoding="utf-8")
