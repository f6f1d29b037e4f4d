"""Source text of functions and classes with everything that they use, for modules that run without Pliant.

Of a class only the methods are written whose names occur in the text; annotations and compilers' decorators are left
out. What comes from other packages is imported.
"""

from __future__ import annotations

import ast
import importlib
import inspect
import math
import re
import textwrap
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from functools import partial
from types import ModuleType
from typing import Any

import numpy as np

from pliant.errors import UserError
from pliant.interfaces.base import Configured
from pliant.interfaces.effect import Effect

OWN = ("pliant",)  # packages of Pliant, and modules of users' files
EFFECT = "Effect"  # base class of effects in the module, which keeps the numbers of a config
PLAIN = (bool, int, float, str, type(None))


class Bundle:
    """Objects to write, with their dependencies.

    Args:
        given: names that the text around the bundle defines.
        called: names of the methods that it calls.
    """

    def __init__(self, given: tuple[str, ...] = (), called: tuple[str, ...] = ()) -> None:
        self._given = {*given, EFFECT}
        self._objects: dict[str, Any] = {}
        self._constants: dict[str, str] = {}
        self._imports: set[str] = set()
        self._used: set[str] = set(called)  # names of attributes
        self._scanned: set[Any] = set()

    def value(self, value: Any) -> str:
        """Return an expression for a value, and add the functions and classes in it.

        Raises:
            UserError: a value that cannot be written.
        """
        if isinstance(value, float) and not math.isfinite(value):
            return f"float('{value}')"
        if isinstance(value, PLAIN):
            return repr(value)
        if isinstance(value, np.generic):
            return self.value(value.item())
        if isinstance(value, np.ndarray):
            self._imports.add("import numpy as np")
            return f"np.array({self.value(value.tolist())})"
        if isinstance(value, re.Pattern):
            self._imports.add("import re")
            return f"re.compile({value.pattern!r})"
        if isinstance(value, Mapping):
            return "{" + ", ".join(f"{self.value(k)}: {self.value(v)}" for k, v in value.items()) + "}"
        if isinstance(value, list | tuple):
            inner = ", ".join(map(self.value, value))
            return f"[{inner}]" if isinstance(value, list) else f"({inner}{',' if len(value) == 1 else ''})"
        return self._call(value)

    def _call(self, value: Any) -> str:
        if isinstance(value, partial):
            self._imports.add("from functools import partial")
            named = [f"{key}={self.value(one)}" for key, one in value.keywords.items()]
            return f"partial({', '.join([self.value(value.func), *map(self.value, value.args), *named])})"
        if isinstance(value, Configured):
            self._add(type(value))
            numbers = value.config.model_dump()
            return f"{type(value).__name__}({', '.join(f'{k}={self.value(v)}' for k, v in numbers.items())})"
        if is_dataclass(value) and not isinstance(value, type):
            self._add(type(value))
            inner = ", ".join(self.value(getattr(value, one.name)) for one in fields(value) if one.init)
            return f"{type(value).__name__}({inner})"
        if callable(value) and hasattr(value, "__name__"):
            self._add(value)
            return str(value.__name__)
        raise UserError(f"an effect keeps a {type(value).__name__}, which cannot be written as Python.")

    def _add(self, wanted: Any) -> None:
        """Add a function or class of Pliant or of a user's file, or an import."""
        wanted = getattr(wanted, "py_func", wanted)
        name = wanted.__name__
        if name in self._given:
            return
        if not wanted.__module__.startswith(OWN):
            if wanted.__module__ != "builtins":
                self._imports.add(f"from {wanted.__module__} import {name}")
            return
        if self._objects.setdefault(name, wanted) is not wanted:
            raise UserError(f"two functions of the effects are called '{name}'; rename the one in your file.")

    def _resolve(self, name: str, scope: Mapping[str, Any]) -> None:
        """Add what a name in a function's text refers to."""
        if name in self._given or name not in scope:
            return
        found = scope[name]
        if isinstance(found, ModuleType):
            own = found.__name__.startswith(OWN)
            if own:
                raise UserError(
                    f"an effect uses the module {found.__name__} as a whole; import its names instead."
                )
            alias = "" if name == found.__name__ else f" as {name}"
            self._imports.add(f"import {found.__name__}{alias}")
        elif isinstance(found, type) or hasattr(found, "__code__") or hasattr(found, "py_func"):
            self._add(found)
        elif callable(found) and not isinstance(found, partial | Configured):
            self._imports.add(f"from {found.__module__} import {name}")
        elif name not in self._constants:
            self._constants[name] = self.value(found)

    def text(self) -> str:
        """Return imports, constants, functions and classes; everything is defined before it is used."""
        while self._scan():
            pass
        pieces = [_unparsed(self._nodes(one)) for one in self._in_order()]
        constants = "\n".join(f"{name} = {value}" for name, value in sorted(self._constants.items()))
        head = "\n".join(sorted(self._imports))
        return "\n\n\n".join(filter(None, [head, constants, *pieces])) + "\n"

    def _scan(self) -> bool:
        """Follow the names in what was added so far; return whether that added anything."""
        before = len(self._objects), len(self._used), len(self._scanned)
        for wanted in list(self._objects.values()):
            for function in _methods(wanted, self._used) if isinstance(wanted, type) else [wanted]:
                if function in self._scanned:
                    continue
                self._scanned.add(function)
                tree = _parsed(function)
                for node in ast.walk(tree):
                    if isinstance(node, ast.Attribute):
                        self._used.add(node.attr)
                    elif isinstance(node, ast.Name):
                        self._resolve(node.id, function.__globals__)
                for imported in _own_imports(function):
                    self._add(imported)
        return before != (len(self._objects), len(self._used), len(self._scanned))

    def _in_order(self) -> Iterator[Any]:
        """Yield functions, then classes behind their bases."""
        functions = [one for one in self._objects.values() if not isinstance(one, type)]
        yield from sorted(functions, key=lambda one: (one.__module__, one.__code__.co_firstlineno))
        done: list[type] = []
        for one in self._objects.values():
            for base in reversed(one.__mro__) if isinstance(one, type) else ():
                if base not in done and (base is one or self._is_written(base)):
                    done.append(base)
        yield from done

    def _is_written(self, cls: type) -> bool:
        own = cls.__module__.startswith(OWN) and cls not in (Configured, Effect)
        return own and bool(_members(cls, self._used))

    def _nodes(self, wanted: Any) -> ast.stmt:
        if not isinstance(wanted, type):
            return _parsed(wanted)
        base = next((one.__name__ for one in wanted.__mro__[1:] if self._is_written(one)), "")
        base = base or (EFFECT if issubclass(wanted, Configured) else "")
        body: list[ast.stmt] = [ast.Expr(ast.Constant(_first_line(wanted)))]
        if is_dataclass(wanted):
            names = [one.name for one in fields(wanted)]
            lines = [f"    self.{name} = {name}" for name in names] or ["    pass"]
            body += ast.parse("\n".join([f"def __init__(self, {', '.join(names)}):", *lines])).body
        for name, member in _members(wanted, self._used).items():
            written = isinstance(member, PLAIN + (tuple,))
            body.append(ast.parse(f"{name} = {member!r}").body[0] if written else _parsed(_function(member)))
        made = ast.parse(f"class {wanted.__name__}{f'({base})' if base else ''}:\n    pass").body[0]
        assert isinstance(made, ast.ClassDef)
        made.body = body
        return made


def _first_line(cls: type) -> str:
    return inspect.cleandoc(cls.__doc__ or "").partition("\n")[0] or cls.__name__


def _members(cls: type, used: set[str]) -> dict[str, Any]:
    """Return the methods and plain attributes of a class that have these names."""
    own = vars(cls)
    named = {name: own[name] for name in own if name in used and not name.startswith("__")}
    if is_dataclass(cls):
        named = {
            name: one for name, one in named.items() if name not in {field.name for field in fields(cls)}
        }
    return {
        name: one
        for name, one in named.items()
        if isinstance(one, PLAIN + (tuple,)) or (_function(one) is not None and not _is_abstract(one))
    }


def _is_abstract(member: Any) -> bool:
    """Return whether a method or property of a class is an abstract one."""
    return bool(getattr(_function(member), "__isabstractmethod__", False))


def _function(member: Any) -> Any:
    """Return the function of a method, property or class method; None for something else."""
    inner = getattr(member, "fget", None) or getattr(member, "__func__", None) or member
    return inner if hasattr(inner, "__code__") else None


def _methods(cls: type, used: set[str]) -> Iterator[Callable[..., Any]]:
    for base in cls.__mro__:
        if base.__module__.startswith(OWN):
            for member in _members(base, used).values():
                if (function := _function(member)) is not None:
                    yield function


def _parsed(function: Any) -> ast.stmt:
    """Return the syntax tree of a function, without annotations, compilers' decorators and imports of Pliant."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    found = _Plain().visit(tree).body[0]
    assert isinstance(found, ast.stmt)
    return ast.fix_missing_locations(found)


def _unparsed(node: ast.stmt) -> str:
    return ast.unparse(ast.fix_missing_locations(node))


def _own_imports(function: Any) -> Iterator[Any]:
    """Yield what a function imports from Pliant or a user's file in its body."""
    for node in ast.walk(ast.parse(textwrap.dedent(inspect.getsource(function)))):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith(OWN):
            module = importlib.import_module(node.module or "")
            yield from (getattr(module, one.name) for one in node.names)


class _Plain(ast.NodeTransformer):
    """Removal of annotations, of numba's decorators and of imports of Pliant."""

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        node.returns = None
        node.decorator_list = [one for one in node.decorator_list if "njit" not in ast.unparse(one)]
        self.generic_visit(node)
        return node

    def visit_arg(self, node: ast.arg) -> ast.AST:
        node.annotation = None
        return node

    def visit_AnnAssign(self, node: ast.AnnAssign) -> ast.AST | None:
        self.generic_visit(node)
        return None if node.value is None else ast.Assign([node.target], node.value)

    def visit_ImportFrom(self, node: ast.ImportFrom) -> ast.AST | None:
        return None if (node.module or "").startswith(OWN) else node
