"""Write docs/reference/: one page per interface and kind, from the code. Run by `make docs`.

python docs/generate.py          write the pages
python docs/generate.py --check  exit with 1 if a page is missing or stale
"""

from __future__ import annotations

import ast
import dataclasses
import importlib.util
import inspect
import re
import sys
from pathlib import Path
from typing import Any

from pydantic_core import PydanticUndefined

from pliant.config.chain import ActuatorConfig, BaseConfig, ChainConfig, SegmentConfig
from pliant.config.measurements import ExcludedSpan, MeasurementsConfig
from pliant.config.study import nested_model, study_model, written_name
from pliant.interfaces.base import FrozenModel
from pliant.registry.component import Component
from pliant.registry.discovery import Registry, discover
from pliant.registry.interface import interfaces
from pliant.units import config_field_unit
from pliant_print.config import MouldConfig, PrinterConfig, SolidConfig
from pliant_search.config import (
    ObjectiveConfig,
    RobustConfig,
    SearchConfig,
    SearchVariableConfig,
    VerifyConfig,
)
from pliant_tables.names import WORDS

REFERENCE = Path(__file__).parent / "reference"
MEASUREMENT_FILES = Path(__file__).parent / "measurement_files.md"
OURS = "pliant "  # packages whose pages are here; others have their own docs
# Interface → further modules with its classes.
PARTS = {"physics": ("simulation",)}
STUDY_KEY = {"effect": "effects"}
# Folders that contain one file per kind; elsewhere a kind has its own folder.
PLURALS = (
    "materials",
    "tasks",
    "effects",
    "families",
    "surrogates",
    "optimizers",
    "pliant_systems",
    "pliant_mjcf",
)
STUDY_BLOCKS: dict[type[FrozenModel], str] = {
    ChainConfig: "chain",
    SegmentConfig: "chain.segments[]",
    BaseConfig: "chain.base",
    ActuatorConfig: "chain.actuators[]",
    MeasurementsConfig: "measurements",
    ExcludedSpan: "measurements.exclude[]",
    SearchConfig: "search",
    SearchVariableConfig: "search.variables.NAME",
    ObjectiveConfig: "search.objective",
    RobustConfig: "search.robust",
    VerifyConfig: "search.verify",
    PrinterConfig: "printer",
    SolidConfig: "solid",
    MouldConfig: "mould",
}
STUDY_INTRODUCTION = [
    "YAML 1.2, with [units](../conventions.md#units) where you like; duplicate and unknown keys are errors. A block",
    "with a `kind` belongs to that plugin, whose page lists the other keys; a kind alone (`physics: mujoco`) is a",
    "block with defaults. `pliant schema` prints a JSON schema for editors.",
    "",
    "- `extends: other.yaml` merges another study first: blocks key by key, lists as a whole; another `kind` clears",
    "  the block; `null` takes a block out. Paths are relative to the file that states them.",
    "- `extends: {file: other.yaml, values_sha256: 5f0b1c64e1d2a7c3}` says in addition what the base held:",
    "  [studies that Pliant writes](../extend_and_improve.md#extend).",
    "- `key=value` after the file [on the command line](../command_line.md#every-verb) changes the study.",
]
FIRST_ON_THE_INDEX = [
    "## Rules and formats",
    "",
    "- [Command line, results, tables](../command_line.md): options, exit codes, JSON keys, CSV columns.",
    "- [Conventions](../conventions.md): frames, signs, units, with a figure.",
    "- [Glossary](../glossary.md): each term with its meaning, symbol and unit.",
    "- [Formats that others rely on](../formats.md): JSON keys that stay, where each other format is described.",
    "",
    "## Generated from the code",
    "",
    "- [Study file](study.md): every key of a study.",
    "- [Effect catalogue](effects.md): what a model may lack, what gives it away, the run that shows it.",
    "- [Effects of models of your own](effects_of_models.md): of Python functions and MuJoCo models.",
    "- [Python](../python.md): the commands as functions, records, what plugins may rely on.",
    "- [Records for plugins](records.md): meshes, problems, states, laws, chains, field by field.",
    "- [Mechanics of chains](mechanics.md): poses, rotations, efforts, equilibria, for engines.",
    "- [Meshing helpers](meshing.md): lattices, blocks, holes, faces, masses.",
    "- [Units, fields of a component](plugin_basics.md): types of a config's fields, a manifest's entry.",
]
INTERFACE_CLASS = {
    "family": "ActuatorFamily",
    "material": "Material",
    "fem": "FEMBackend",
    "surrogate": "Surrogate",
    "meta_model": "MetaModel",
    "effect": "Effect",
    "physics": "PhysicsBackend",
    "task": "Task",
    "optimizer": "Optimizer",
    "viewer": "Viewer",
    "model": "SystemModel",
    "bench": "Bench",
}


def _beside(name: str) -> Any:
    """Load a script of this folder: `catalogue`, on effects, or `plugin_pages`, on the building blocks of plugins."""
    spec = importlib.util.spec_from_file_location(name, Path(__file__).parent / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def pages(registry: Registry) -> dict[Path, str]:
    """Return path → text of every reference page."""
    made = {REFERENCE / "index.md": _index(registry), REFERENCE / "study.md": _study_page()}
    made[REFERENCE / "effects.md"] = _beside("catalogue").catalogue(_ours(registry, "effect"))
    effects = [c for c in registry.components if c.interface == "effect" and c.package.startswith(OURS)]
    own = [c for c in effects if "chain" not in c.models]
    made[REFERENCE / "effects_of_models.md"] = _beside("catalogue").models_catalogue(own)
    made |= _beside("plugin_pages").pages(REFERENCE, _markdown, _class_text)
    for interface in interfaces():
        made[REFERENCE / interface / "index.md"] = _interface_page(interface, registry)
        for component in _ours(registry, interface):
            made[REFERENCE / interface / f"{component.kind}.md"] = _kind_page(component)
    made[MEASUREMENT_FILES] = _with_words(MEASUREMENT_FILES.read_text(encoding="utf-8"))
    return made


def _with_words(page: str) -> str:
    """Return the page on measurement files with the words that the reader knows, between its marks."""
    rows = ["| column | words |", "|---|---|"]
    for name, words in WORDS.items():
        told = [word.replace("#", "1").replace("@", "x") for word in words]
        rows.append(f"| `{name.replace('#', '1').replace('@', 'x')}` | {', '.join(told)} |")
    begin, end = "<!-- words: docs/generate.py -->\n", "\n<!-- end -->"
    return re.sub(f"({begin}).*?({end})", lambda m: m[1] + "\n".join(rows) + m[2], page, flags=re.DOTALL)


def _ours(registry: Registry, interface: str) -> list[Component]:
    return [c for c in registry.by_interface(interface) if c.package.startswith(OURS)]


def _index(registry: Registry) -> str:
    lines = ["# Reference", "", *FIRST_ON_THE_INDEX]
    for interface in interfaces():
        kinds = ", ".join(f"[{c.kind}]({interface}/{c.kind}.md)" for c in _ours(registry, interface))
        lines.append(
            f"- [{INTERFACE_CLASS[interface]}]({interface}/index.md): {kinds or 'no kind ships yet'}"
        )
    return "\n".join(lines) + "\n"


def _study_page() -> str:
    lines = ["# Study file", "", *STUDY_INTRODUCTION, "", *_keys(study_model({}, discover())), ""]
    for model in STUDY_BLOCKS:
        lines += [
            f"## {STUDY_BLOCKS[model]}",
            "",
            _markdown(inspect.getdoc(model) or ""),
            "",
            *_keys(model),
            "",
        ]
    return "\n".join(lines)


def _interface_page(interface: str, registry: Registry) -> str:
    name = INTERFACE_CLASS[interface]
    place = interfaces()[interface].config.partition(":")[0]
    parts = [f"pliant.interfaces.{part}" for part in PARTS.get(interface, ())]
    modules = [importlib.import_module(one) for one in (place, *parts)]
    main = getattr(modules[0], name)
    others = [
        cls
        for module in modules
        for cls in vars(module).values()
        if inspect.isclass(cls) and cls.__module__ == module.__name__ and cls is not main
    ]
    lines = [f"# {name}", "", f"`{place}`", "", *_class_text(main)]
    kinds = _ours(registry, interface)
    lines += ["## Kinds that ship", ""]
    lines += [f"- [{c.kind}]({c.kind}.md): {c.summary}" for c in kinds] or ["None yet."]
    for cls in others:
        lines += ["", f"## {cls.__name__}", "", *_class_text(cls)]
    return "\n".join(lines).rstrip() + "\n"


def _class_text(cls: type[Any]) -> list[str]:
    lines = [_markdown(inspect.getdoc(cls) or ""), ""]
    if issubclass(cls, FrozenModel):
        return lines + ([*_keys(cls), ""] if len(cls.model_fields) > 1 else [])
    if dataclasses.is_dataclass(cls) and dataclasses.fields(cls):
        lines += [*_beside("plugin_pages").fields(cls), ""]
    for method, function in vars(cls).items():
        wanted = inspect.isfunction(function) or isinstance(function, property)
        if wanted and not method.startswith("_"):
            lines += [*_method(method, function), ""]
    return lines


def _method(name: str, function: Any) -> list[str]:
    if isinstance(function, property):
        return [f"### `{name}`", "", _markdown(inspect.getdoc(function.fget) or "")]
    signature = inspect.signature(function)
    shown = [p for p in signature.parameters.values() if p.name != "self"]
    text = f"{name}{signature.replace(parameters=shown)}".replace("'", "")
    return [f"### `{text}`", "", _markdown(inspect.getdoc(function) or "")]


def _markdown(docstring: str) -> str:
    """Return a docstring in Markdown; Google-style sections and formulas keep their layout as quoted blocks."""
    lines, block = [], False
    for line in docstring.splitlines():
        indented = line.startswith("    ")
        if indented and not block:
            lines.append("")
        lines.append(line)
        block = indented
    return "\n".join(lines)


def _kind_page(component: Component) -> str:
    model = component.config_model()
    lines = [
        f"# {component.interface}: {component.kind}",
        "",
        f"{component.summary[0].upper()}{component.summary[1:]}.",
        "",
        *_when(component),
        *_requirement(component),
        *_usage(component),
        "## Keys",
        "",
        *_keys(model),
        "",
        *_inner(model),
        "## What it does",
        "",
        *_docstrings(component.implementation),
        *_see_catalogue(component),
        *_presets(component),
        f"Check it: `pliant check {component.interface} {component.kind}`. "
        f"Contract: [{INTERFACE_CLASS[component.interface]}](index.md).",
    ]
    return "\n".join(lines) + "\n"


def _when(component: Component) -> list[str]:
    """Return the use of an optimizer, from its config's docstring: the implementation may need a heavy library."""
    if component.interface != "optimizer":
        return []
    return [_markdown(inspect.getdoc(component.config_model()) or ""), ""]


def _usage(component: Component) -> list[str]:
    """Return the block in a study; a viewer is an option of two verbs instead."""
    if component.interface == "viewer":
        return [f"`pliant render STUDY.yaml --viewer {component.kind}`", ""]
    return ["```yaml", *_example(component), "```", ""]


def _presets(component: Component) -> list[str]:
    """Return a table of the rubbers that a kind of material knows by name."""
    presets = component.implementation_class().presets() if component.interface == "material" else ()
    if not presets:
        return []
    rows = [
        "## Known by name",
        "",
        "Stresses in kPa. The modulus is that of the block; behind it what sources give. "
        "Densities and hardness are quoted from makers and were not compared with their data sheets; "
        "measure your batch.",
        "",
        "| name | law, incompressible | shear modulus | density kg/m³ | Shore | stretch | source |",
        "|---|---|---|---|---|---|---|",
    ]
    for one in presets:
        spread = f" ({one.range_pa[0] / 1e3:g} to {one.range_pa[1] / 1e3:g})" if one.range_pa else ""
        modulus = f"{one.shear_modulus_pa / 1e3:.4g}{spread}"
        low, high = one.stretch
        law = one.law.replace(" kPa", "").replace("_", " ")
        cells = (
            one.name,
            law,
            modulus,
            f"{one.config.density_kg_m3:g}",
            one.hardness,
            f"{low:g} to {high:g}",
            one.source,
        )
        rows.append(f"| {' | '.join(cells)} |")
    return [*rows, ""]


def _see_catalogue(component: Component) -> list[str]:
    if component.interface != "effect":
        return []
    paragraphs = ["## In the data", *_beside("catalogue").facts(component)]
    picture = f"![{component.kind}: the run that shows it](../../pictures/effects/{component.kind}.png)"
    others = "What the table and the picture mean, and the other effects: [effect catalogue](../effects.md)."
    return [line for paragraph in (*paragraphs, picture, others) for line in (paragraph, "")]


def _inner(model: type[FrozenModel]) -> list[str]:
    """Return the keys of the blocks inside a kind's block, such as `coefficients`."""
    lines = []
    for name, field in model.model_fields.items():
        inner = nested_model(field.annotation)
        if inner is not None:
            heading = f"### {written_name(model, name)}"
            lines += [heading, "", _markdown(inspect.getdoc(inner) or ""), "", *_keys(inner), ""]
    return lines


def _requirement(component: Component) -> list[str]:
    if component.lazy:
        return [f"Needs {', '.join(component.lazy)} for part of its work: `{component.install}`.", ""]
    if not component.requires:
        return []
    extra = (
        "pip install 'pliant[pybullet]' (Python 3.11)" if component.kind == "pybullet" else component.install
    )
    return [f"Needs {', '.join(component.requires)}: `{extra}`.", ""]


def _example(component: Component) -> list[str]:
    key = STUDY_KEY.get(component.interface, component.interface)
    inner = ", ".join(
        [f"kind: {component.kind}", *(f"{k}: {_flow(v)}" for k, v in component.smallest_block().items())]
    )
    return [f"{key}: [{{{inner}}}]" if key == "effects" else f"{key}: {{{inner}}}"]


def _flow(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{k}: {_flow(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_flow(item) for item in value) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str) and Path(value).is_absolute():  # of a file that ships with a plugin
        return Path(value).name
    return f"{value:g}" if isinstance(value, float) and float(f"{value:g}") == value else str(value)


def _keys(model: type[FrozenModel]) -> list[str]:
    rows = ["| key | unit | default | allowed | meaning |", "|---|---|---|---|---|"]
    for name, field in model.model_fields.items():
        if name == "kind":
            continue
        written = written_name(model, name)
        default = (
            "required"
            if field.default is PydanticUndefined and field.is_required()
            else f"`{_default(field)}`"
        )
        cells = (
            f"`{written}`",
            config_field_unit(model, name),
            default,
            _limits(field),
            field.description or "",
        )
        rows.append(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |")
    return rows if len(rows) > 2 else ["It has no keys but `kind`."]


def _default(field: Any) -> str:
    value = field.get_default(call_default_factory=True)
    if isinstance(value, FrozenModel):
        return "all defaults"
    return "none" if value is None else _flow(value)


def _limits(field: Any) -> str:
    parts = []
    for limit in field.metadata:
        for attribute, sign in (("gt", ">"), ("ge", "≥"), ("lt", "<"), ("le", "≤")):
            bound = getattr(limit, attribute, None)
            if bound is not None:
                parts.append(f"{sign} {bound:g}")
    text = str(field.annotation)
    if "Literal" in text:
        parts.append(
            text[text.index("Literal[") + 8 : text.index("]", text.index("Literal["))].replace("'", "")
        )
    return ", ".join(parts)


def _docstrings(reference: str) -> list[str]:
    """Return docstrings of the class and of its package's files, read without importing: an engine may be missing."""
    module, _, name = reference.partition(":")
    spec = importlib.util.find_spec(module)
    assert spec is not None
    assert spec.origin is not None
    source = Path(spec.origin)
    tree = ast.parse(source.read_text(encoding="utf-8"))
    classes = {node.name: node for node in tree.body if isinstance(node, ast.ClassDef)}
    if name not in classes:
        raise LookupError(f"{reference} is not defined where its manifest says")
    lines = [_markdown(ast.get_docstring(classes[name]) or ""), ""]
    alone = source.parent.name in PLURALS
    for path in [source] if alone else sorted(source.parent.glob("*.py")):
        text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
        if path.name in ("__init__.py", "config.py") or not text:
            continue
        lines += [f"**`{path.name}`** {_markdown(text)}", ""]
    return lines


def main() -> int:
    """Write or check the pages."""
    registry = discover()
    made = pages(registry)
    if "--check" in sys.argv:
        stale = [p for p, text in made.items() if not p.is_file() or p.read_text(encoding="utf-8") != text]
        for path in stale:
            print(f"{path} is missing or stale; run 'make docs'.")
        return 1 if stale else 0
    for path in set(REFERENCE.rglob("*.md")) - set(made):
        path.unlink()
    for path, text in made.items():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    print(f"{len(made)} pages in {REFERENCE}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
