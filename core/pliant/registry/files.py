"""Effects from a user's Python file: found without a package, treated and listed as any other effect.

A file is executed once per version of its code, as a module `pliant_file_…` named after that code: the keys of results
depend on its content, not on its path.
"""

from __future__ import annotations

import importlib.util
import inspect
import re
import sys
import traceback
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any, get_args, get_type_hints

from pliant.errors import UserError
from pliant.interfaces.effect import Effect, EffectConfig
from pliant.registry.blame import FILE_MODULE as FILE_MODULE
from pliant.registry.blame import describe_error
from pliant.registry.blame import shown as shown
from pliant.registry.component import Component
from pliant.registry.discovery import CHANGES, Registry, ask
from pliant.registry.manifests import CONTRACT_VERSION
from pliant.registry.source_code import source_digest

HOOK = "pliant_components"


def with_files(registry: Registry, files: Sequence[Path]) -> Registry:
    """Return the registry with the effects of these Python files; files that it already has are ignored.

    A file's effects are its concrete subclasses of `Effect`, each with the config that its annotation `config:`
    names; or the result of its hook `pliant_components`.

    Raises:
        UserError: a file that does not exist, is not Python, fails, has no effect, or uses an existing kind.
    """
    components = list(registry.components)
    for file in files:
        for component in load_components(file):
            there = next((one for one in components if _is_same_kind(one, component)), None)
            if there is None:
                components.append(component)
            elif there.implementation != component.implementation:
                raise UserError(
                    f"{shown(file)}: it defines {component.label}, and {there.package or 'Pliant'} has one of that "
                    "name; give yours another kind."
                )
    return replace(registry, components=tuple(components))


def _is_same_kind(one: Component, other: Component) -> bool:
    """Return whether both have one name; effects of different kinds of models may share theirs."""
    if (one.interface, one.kind) != (other.interface, other.kind):
        return False
    return one.interface != "effect" or bool(set(one.models) & set(other.models))


def load_components(file: Path) -> list[Component]:
    """Return the components that a Python file defines; raise `UserError` as `with_files` does."""
    module = load_module(file)
    package = file.name
    if hasattr(module, HOOK):
        try:
            return ask(module, package)
        except Exception as error:  # a hook may raise anything
            raise UserError(f"{_place(file, error)}: {HOOK} fails ({describe_error(error)}).") from error
    own = [c for c in vars(module).values() if inspect.isclass(c) and c.__module__ == module.__name__]
    effects = [c for c in own if issubclass(c, Effect) and not inspect.isabstract(c)]
    if not effects:
        raise UserError(f"{shown(file)}: it holds no effect; {_what_is_missing(own)}.")
    return [_component(effect, own, module, file) for effect in effects]


def effect_files(registry: Registry) -> tuple[str, ...]:
    """Return the files of this registry's effects, for `with_files` elsewhere."""
    modules = {component.config.partition(":")[0]: None for component in registry.components}
    return tuple(str(sys.modules[name].__file__) for name in modules if name.startswith(FILE_MODULE))


def not_run_yet(files: Sequence[Path]) -> list[Path]:
    """Return the files whose code this process has not executed."""
    ran = {module.__file__ for name, module in list(sys.modules.items()) if name.startswith(FILE_MODULE)}
    return [file for file in files if str(file.resolve()) not in ran]


def load_module(file: Path) -> ModuleType:
    """Return a Python file as a module, executed once per version of its code; errors as of `with_files`."""
    try:
        source = file.read_bytes()
    except FileNotFoundError:
        raise UserError(
            f"{shown(file)}: no such file; Python files are named from the study's folder."
        ) from None
    except (OSError, ValueError) as error:
        raise UserError(
            f"{shown(file)}: it cannot be read ({getattr(error, 'strerror', None) or error})."
        ) from None
    try:
        code = compile(source, str(file.resolve()), "exec")
    except (SyntaxError, ValueError) as error:
        line = f", line {error.lineno}" if isinstance(error, SyntaxError) and error.lineno else ""
        raise UserError(
            f"{shown(file)}{line}: this is not Python ({getattr(error, 'msg', error)})."
        ) from None
    stem = re.sub(r"\W", "_", file.stem, flags=re.ASCII)
    name = f"{FILE_MODULE}{stem}_{source_digest(source)[:12]}"
    there = sys.modules.get(name)
    if there is not None and there.__file__ == str(file.resolve()):
        return there
    spec = importlib.util.spec_from_file_location(name, file.resolve())
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # pydantic resolves annotations through it
    try:
        exec(code, vars(module))  # not the loader, which may use a stale .pyc of a file that was just edited
    except KeyboardInterrupt:
        sys.modules.pop(name)
        raise
    except BaseException as error:  # user code may raise anything, even SystemExit
        sys.modules.pop(name)
        raise UserError(
            f"{_place(file, error)}: the file fails when it is loaded ({describe_error(error)})."
        ) from error
    return module


def _component(effect: type[Effect], own: Sequence[type[Any]], module: ModuleType, file: Path) -> Component:
    config = _find_config(effect, own, file)
    if "parameters" in vars(effect):
        raise UserError(
            f"{_location(effect, file)}: {effect.__name__} is written for contract 1, this Pliant has "
            f"{CONTRACT_VERSION}: {CHANGES[2]} (docs/plugin_contract.md)."
        )
    kind = config.model_fields["kind"]
    words = (kind.default,) if isinstance(kind.default, str) else get_args(kind.annotation)
    if len(words) != 1 or kind.default != words[0]:
        raise UserError(
            f"{_location(config, file)}: {config.__name__} does not say its kind; write "
            f'\'kind: Literal["my_effect"] = "my_effect"\' in it.'
        )
    text = inspect.getdoc(module) or inspect.getdoc(effect) or effect.__name__
    component = Component(
        interface="effect",
        kind=words[0],
        config=f"{module.__name__}:{config.__name__}",
        implementation=f"{module.__name__}:{effect.__name__}",
        summary=text.splitlines()[0].rstrip("."),
        models=effect.models,
        package=file.name,
    )
    problem = component.problem()
    if problem:
        raise UserError(f"{shown(file)}: {problem}.")
    return component


def _find_config(effect: type[Effect], own: Sequence[type[Any]], file: Path) -> type[EffectConfig]:
    """Return the config in the annotation of the class or its `__init__`, or the only one of the file."""
    configs = [c for c in own if issubclass(c, EffectConfig)]
    for annotated in (effect, effect.__init__):
        try:
            found = get_type_hints(annotated).get("config")
        except Exception as error:  # an annotation with an undefined name
            raise UserError(
                f"{_location(effect, file)}: {effect.__name__}: {describe_error(error)}."
            ) from error
        if inspect.isclass(found) and issubclass(found, EffectConfig) and found is not EffectConfig:
            return found
    if len(configs) == 1:
        return configs[0]
    raise UserError(
        f"{_location(effect, file)}: {effect.__name__} does not say which config it has; write 'config: MyConfig' in "
        "it, MyConfig being a subclass of pliant.interfaces.effect.EffectConfig."
    )


def _what_is_missing(own: Sequence[type[Any]]) -> str:
    unfinished = next((c for c in own if issubclass(c, Effect)), None)
    if unfinished is not None:
        lacks = " and ".join(sorted(unfinished.__abstractmethods__))
        return f"class {unfinished.__name__} has no method {lacks}"
    return "define a subclass of pliant.interfaces.effect.Effect with the method apply"


def _location(cls: type[Any], file: Path) -> str:
    try:
        return f"{shown(file)}, line {inspect.getsourcelines(cls)[1]}"
    except (OSError, TypeError):
        return shown(file)


def _place(file: Path, error: BaseException) -> str:
    """Return the last line of this file in the error's traceback."""
    lines = [f.lineno for f in traceback.extract_tb(error.__traceback__) if f.filename == str(file.resolve())]
    return f"{shown(file)}, line {lines[-1]}" if lines else shown(file)
