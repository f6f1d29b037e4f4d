"""The Python reference: a page for each module that docs/plugin_contract.md calls public, from its docstrings.

`pliant` comes first, with the names of its `__all__`; a module does not show again what `pliant` shows. Interfaces have
pages of their own in docs/reference and get none here.
"""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import re
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import pliant
from pliant.registry.component import INTERFACES

if TYPE_CHECKING:
    from sphinx.application import Sphinx

DOCS = Path(__file__).parents[1]
PAGES = DOCS / "python"  # not in the repository; made anew by every build
FIRST = ("pliant", "pliant.api")
# What stands in backticks, or a character that is none of reStructuredText's here.
MARKUP = re.compile(r"(`+[^`]*`+)|([|*]|(?<=\w)_(?!\w))")
SECTIONS = ("Args:", "Attributes:", "Returns:", "Raises:", "Yields:", "Example:", "Examples:", "Note:")
HAVE_PAGES = {f"pliant.interfaces.{interface}" for interface in INTERFACES}


def public_modules() -> list[str]:
    """Names of the modules in the contract's table "What is public", `*` written out."""
    text = (DOCS / "plugin_contract.md").read_text(encoding="utf-8")
    table = text.partition("## What is public")[2].partition("\n## ")[0]
    rows = [
        re.findall(r"`(pliant[\w.]*(?:\.\*)?)`", line.split("|")[1])
        for line in table.splitlines()
        if "|" in line
    ]
    found = list(FIRST)
    for name in (name for row in rows for name in row):
        package = importlib.import_module(name.removesuffix(".*"))
        inside = pkgutil.iter_modules(package.__path__, f"{package.__name__}.") if name.endswith(".*") else ()
        found += [module.name for module in inside] or [name]
    return [name for name in dict.fromkeys(found) if name not in HAVE_PAGES]


def public_names(module: ModuleType) -> list[str]:
    """What a module shows: its `__all__`, else the classes and functions that it defines."""
    if stated := getattr(module, "__all__", None):
        return list(stated)
    made_here = [
        name
        for name, value in vars(module).items()
        if (inspect.isclass(value) or inspect.isfunction(value)) and value.__module__ == module.__name__
    ]
    return [name for name in made_here if not name.startswith("_")]


def page(module: ModuleType) -> str:
    """The page of a module, in reStructuredText."""
    name = module.__name__
    shown_at_the_door = {id(getattr(pliant, one)) for one in getattr(pliant, "__all__", ())}
    again = [one for one in public_names(module) if id(getattr(module, one)) in shown_at_the_door]
    lines = [name, "=" * len(name), "", f".. automodule:: {name}"]
    if module is not pliant and again:
        lines.append(f"   :exclude-members: {', '.join(again)}")
    return "\n".join([*lines, ""])


def write_pages(app: Sphinx) -> None:
    """Write the pages whose text changed, so that an unchanged module is not read anew."""
    PAGES.mkdir(exist_ok=True)
    made = {PAGES / f"{name}.rst": page(importlib.import_module(name)) for name in public_modules()}
    for path in set(PAGES.iterdir()) - set(made):
        path.unlink()
    for path, text in made.items():
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def list_pages(app: Sphinx, docname: str, source: list[str]) -> None:
    """Under docs/python.md: every module with its first sentence."""
    if docname == "docs/python":
        names = public_modules()
        rows = [f"| [{name}](python/{name}.rst) | {summary(name)} |" for name in names]
        tree = ["```{toctree}", ":hidden:", "", *(f"python/{name}" for name in names), "```"]
        source[0] += "\n".join(["", "| module | |", "|---|---|", *rows, "", *tree, ""])


def summary(name: str) -> str:
    """The first line of a module's docstring."""
    return (inspect.getdoc(importlib.import_module(name)) or "").partition("\n")[0].replace("|", "\\|")


def from_markdown(app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]) -> None:
    """A docstring, written as Markdown with Google's sections, in reStructuredText.

    Characters that would be markup there (|u|, a * b, names_) are escaped, and an indented block is one of code or of
    formulas, as in Markdown.
    """
    made: list[str] = []
    literal = section = False
    for line in lines:
        if line.strip():
            indented = line.startswith("    ")
            if not indented:
                literal, section = False, line in SECTIONS
            elif not section and not literal and not (made and made[-1].strip()):
                literal = True
                if not any(one.endswith("::") for one in made[-2:]):
                    made += ["::", ""]
        made.append(line if literal else escaped(line))
    lines[:] = made


def escaped(line: str) -> str:
    """A line with the characters escaped that reStructuredText would read as markup, but for those in backticks."""
    return MARKUP.sub(lambda found: found[1] or f"\\{found[2]}", line)


def escape_types(app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]) -> None:
    """The same for the types that napoleon adds from annotations."""
    lines[:] = [escaped(line) if line.startswith(":vartype") else line for line in lines]


def setup(app: Sphinx) -> dict[str, Any]:
    """Called by Sphinx."""
    app.connect("builder-inited", write_pages)
    app.connect("source-read", list_pages)
    app.connect(
        "autodoc-process-docstring", from_markdown, priority=400
    )  # before napoleon makes markup of its own
    app.connect("autodoc-process-docstring", escape_types, priority=600)
    return {"parallel_read_safe": True}
