"""The Python reference: a page for each module that docs/plugin_contract.md calls public, from its docstrings.

`pliant` comes first, with the names of its `__all__`, and the modules behind them; a module does not show again what
`pliant` shows. Interfaces have separate pages in docs/reference and get none here.
"""

from __future__ import annotations

import functools
import importlib
import inspect
import pkgutil
import re
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import pliant
from pliant.registry.interface import interfaces

if TYPE_CHECKING:
    from sphinx.application import Sphinx

DOCS = Path(__file__).parents[1]
PAGES = DOCS / "python"  # not in the repository; rewritten by every build
# Text in backticks, or a character that has no markup meaning here.
MARKUP = re.compile(r"(`+[^`]*`+)|([|*]|(?<=\w)_(?!\w))")
SECTIONS = ("Args:", "Attributes:", "Returns:", "Raises:", "Yields:", "Example:", "Examples:", "Note:")
HAVE_PAGES = {interface.config.partition(":")[0] for interface in interfaces().values()}


def public_modules() -> list[str]:
    """Return `pliant`, the modules of its names, then those of the contract's table "What is public", `*` expanded."""
    text = (DOCS / "plugin_contract.md").read_text(encoding="utf-8")
    table = text.partition("## What is public")[2].partition("\n## ")[0]
    found = ["pliant", *behind_the_door(), "pliant.api"]
    for line in table.splitlines():
        for name in re.findall(r"`(pliant[\w.]*(?:\.\*)?)`", line.split("|")[1]) if "|" in line else ():
            package = importlib.import_module(name.removesuffix(".*"))
            inside = pkgutil.iter_modules(package.__path__, f"{name[:-1]}") if name.endswith(".*") else ()
            found += [module.name for module in inside] or [name]
    return [name for name in dict.fromkeys(found) if name not in HAVE_PAGES]


def behind_the_door() -> list[str]:
    """Return modules that define the names of `pliant`, and the bases of their classes: the types of its results."""
    found = []
    for module in {getattr(pliant, name).__module__: None for name in stated_names(pliant)}:
        classes = [
            value for value in vars(importlib.import_module(module)).values() if inspect.isclass(value)
        ]
        own = [cls for cls in classes if cls.__module__ == module]
        found += [module, *(base.__module__ for cls in own for base in cls.__mro__)]
    return [name for name in found if name.startswith("pliant.")]


def stated_names(module: ModuleType) -> list[str]:
    """Return the names of a module's `__all__`."""
    return list(getattr(module, "__all__", ()))


def page(module: ModuleType) -> str:
    """Return the page of a module, in reStructuredText: a directive for each of its names.

    The names of `pliant` are accessed one by one, since they are imported only then.
    """
    name = module.__name__
    lines = [name, "=" * len(name), "", f".. automodule:: {name}", "   :no-members:"]
    shown = {one: getattr(pliant, one) for one in stated_names(pliant)}
    names = shown if module is pliant else defined_in(module, [id(value) for value in shown.values()])
    for one, value in names.items():
        lines += ["", f".. auto{'class' if inspect.isclass(value) else 'function'}:: {name}.{one}"]
    return "\n".join([*lines, ""])


def defined_in(module: ModuleType, but: Sequence[int]) -> dict[str, Any]:
    """Return classes and functions that a module defines and documents, without those with an id of `but`."""
    found = {}
    for name, value in vars(module).items():
        made_of = value.func if isinstance(value, functools.partial) else value
        written = inspect.isclass(value) or inspect.isfunction(inspect.unwrap(made_of))
        here = getattr(made_of, "__module__", None) == module.__name__ and made_of.__doc__
        if written and here and not name.startswith("_") and id(value) not in but:
            found[name] = value
    return found


def write_pages(app: Sphinx) -> None:
    """Write the pages whose text changed, so that an unchanged module is not parsed again."""
    PAGES.mkdir(exist_ok=True)
    made = {PAGES / f"{name}.rst": page(importlib.import_module(name)) for name in public_modules()}
    for path in set(PAGES.iterdir()) - set(made):
        path.unlink()
    for path, text in made.items():
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def list_pages(app: Sphinx, docname: str, source: list[str]) -> None:
    """Append to docs/python.md the list of modules with their first sentences."""
    if docname == "docs/python":
        names = public_modules()
        rows = [f"| [{name}](python/{name}.rst) | {summary(name)} |" for name in names]
        tree = ["```{toctree}", ":hidden:", "", *(f"python/{name}" for name in names), "```"]
        source[0] += "\n".join(["", "| module | |", "|---|---|", *rows, "", *tree, ""])


def always(app: Sphinx, *_: object) -> list[str]:
    """Return the list of modules as a page that every build reads, since modules come and go."""
    return ["docs/python"]


def summary(name: str) -> str:
    """Return the first line of a module's docstring."""
    return (inspect.getdoc(importlib.import_module(name)) or "").partition("\n")[0].replace("|", "\\|")


def from_markdown(app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]) -> None:
    """Return a docstring, written as Markdown with Google's sections, in reStructuredText.

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
    """Return a line with characters escaped that reStructuredText would read as markup, except those in backticks."""
    return MARKUP.sub(lambda found: found[1] or f"\\{found[2]}", line)


def escape_types(app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]) -> None:
    """Escape the types that napoleon adds from annotations in the same way."""
    lines[:] = [escaped(line) if line.startswith(":vartype") else line for line in lines]


def setup(app: Sphinx) -> dict[str, Any]:
    """Connect the Python reference to Sphinx."""
    app.connect("builder-inited", write_pages)
    app.connect("source-read", list_pages)
    app.connect("env-get-outdated", always)
    app.connect(
        "autodoc-process-docstring", from_markdown, priority=400
    )  # before napoleon makes its own markup
    app.connect("autodoc-process-docstring", escape_types, priority=600)
    return {"parallel_read_safe": True}
