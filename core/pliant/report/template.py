"""The page's template, and its digest: no import statement leads to it, so no code fingerprint holds it."""

from __future__ import annotations

import hashlib
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


def digest() -> str:
    """SHA-256 of the template's text: part of the report's key, beside the code."""
    return hashlib.sha256(_source(NAME).encode()).hexdigest()


def _source(name: str) -> str:
    return (files("pliant.report") / "templates" / name).read_text(encoding="utf-8")
