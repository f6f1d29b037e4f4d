"""Discovery of plugins by entry points of group `pliant`; a broken plugin is recorded and never fatal."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import ModuleType
from typing import Any, cast

import pluggy

from pliant.errors import MissingDependencyError, UserError, closest
from pliant.interfaces.base import ComponentConfig
from pliant.interfaces.effect import AT, Effect, EffectConfig, EffectParameter
from pliant.interfaces.material import MaterialConfig, with_regions
from pliant.records.actuation import register
from pliant.registry.block import Block, blocks
from pliant.registry.command import Command, commands
from pliant.registry.component import Component
from pliant.registry.data_kind import DataKind, data_kinds
from pliant.registry.failures import FailedPlugin, configured, first_line, implemented
from pliant.registry.function import Function, functions
from pliant.registry.guarded_effect import GuardedEffect
from pliant.registry.interface import Interface, interfaces
from pliant.registry.law_source import LawSource, law_sources
from pliant.registry.manifests import CONTRACT_VERSION, Entry, distribution_name, entry_points, hooked
from pliant.registry.residual_model import ResidualModel, residual_models
from pliant.registry.result_folder import ResultFolder, result_folders
from pliant.registry.shipped import REMEDY, shipped_in
from pliant.registry.stored_record import StoredRecord, stored_records

# The kind of model of studies without a block `model`: a chain of modules.
CHAIN = "chain"
# (kind of effect, declared parameter) → the parameter of a model.
Adapted = Callable[[str, EffectParameter], EffectParameter]
# kind of effect → the model's own words on it, "" without
Words = Callable[[str], str]
# Contract number → changes that a plugin of the previous number needs.
CHANGES = {
    2: "an effect declares each parameter once, as a field of its config by `parameter(…)`, and no longer in a list "
    "`parameters` of its class; an optimizer proposes and is told `Trial`s",
    3: "import public names by the paths in the table 'What each number changed'",
}

# Hook → class of its entries, and the call that returns those of all packages.
ENTRIES: Mapping[str, tuple[type[Any], Callable[[], Mapping[str, Entry]]]] = {
    "pliant_interfaces": (Interface, interfaces),
    "pliant_commands": (Command, commands),
    "pliant_blocks": (Block, blocks),
    "pliant_records": (StoredRecord, stored_records),
    "pliant_folders": (ResultFolder, result_folders),
    "pliant_data": (DataKind, data_kinds),
    "pliant_law_sources": (LawSource, law_sources),
    "pliant_residual_models": (ResidualModel, residual_models),
    "pliant_functions": (Function, functions),
}


@dataclass(frozen=True)
class Registry:
    """All discovered components, and failed plugins.

    Attributes:
        components, failures: of all packages.
        clashes: interface and kind → the places of kinds that are defined twice.
        model: the kind of model whose effects are meant, "" for all; several kinds may have effects of one name.
        adapted: gives a declared parameter of an effect, by its kind, the plausible range for the model at hand.
        words: gives an effect at a place of the model at hand, by its kind, the model's own summary.
    """

    components: tuple[Component, ...]
    failures: tuple[FailedPlugin, ...] = ()
    clashes: Mapping[tuple[str, str], tuple[str, ...]] = field(default_factory=dict)
    model: str = CHAIN
    adapted: Adapted | None = None
    words: Words | None = None

    def for_model(self, kind: str, adapted: Adapted | None = None, words: Words | None = None) -> Registry:
        """Return the registry with the effects of this kind of model, their parameters adapted to the model at hand."""
        return replace(self, model=kind, adapted=adapted, words=words)

    def by_interface(self, interface: str) -> tuple[Component, ...]:
        """Return the components of one interface, sorted by kind; of effects those for the kind of model."""
        found = (c for c in self.components if c.interface == interface and self._is_meant(c))
        return tuple(sorted(found, key=lambda c: c.kind))

    def _is_meant(self, component: Component) -> bool:
        return component.interface != "effect" or not self.model or self.model in component.models

    def fit_parameters(self, kind: str, forms: bool = False) -> tuple[EffectParameter, ...]:
        """Return the parameters of an effect that a fit may vary, scaled to the model; with `forms` those of its form.

        Raises `UserError` for an unknown kind.
        """
        model = cast(type[EffectConfig], self.get("effect", kind).config_model())
        declared = model.form_parameters() if forms else model.fit_parameters()
        adapt = self.adapted
        return declared if adapt is None else tuple(adapt(kind, one) for one in declared)

    def _at_place(self, component: Component, kind: str) -> Component:
        """Return an effect with the places behind its kind, in the model's words."""
        words = self.words(kind) if self.words else ""
        return replace(component, kind=kind, summary=words or component.summary)

    def kinds(self, interface: str) -> list[str]:
        """Return the kinds of one interface."""
        return [component.kind for component in self.by_interface(interface)]

    def get(self, interface: str, kind: str) -> Component:
        """Return the component of this kind; raise `UserError` with the close match and the plugins that failed."""
        plain, at, pattern = kind.partition(AT) if interface == "effect" else (kind, "", "")
        for component in self.components:
            if (component.interface, component.kind) == (interface, plain) and self._is_meant(component):
                return (
                    self._at_place(component, kind) if at and pattern and self.model != CHAIN else component
                )
        if (interface, kind) in self.clashes:
            places = self.clashes[interface, kind]
            remedy = "uninstall one of them" if ":" not in places[0] else "give one of them another kind"
            raise UserError(f"{interface} '{kind}' is defined by {' and '.join(places)}; {remedy}.")
        for failure in self.failures:
            if (interface, kind) in failure.kinds:
                raise UserError(f"{interface} '{kind}' of {failure.package} cannot be used: {failure.cause}.")
        if package := shipped_in(f"{interface} {kind}"):
            raise MissingDependencyError(f"{interface} '{kind}' belongs to the package {package}, {REMEDY}.")
        known = self.kinds(interface)
        near = closest(kind, known)
        message = (
            f"unknown {interface} kind '{kind}'{near} Known kinds: {', '.join(known) or 'none is installed'}."
        )
        if near == ".":
            message += (
                " One of a package of yours is found by the package's entry point, once it is installed."
            )
        if self.failures:
            names = ", ".join(f"{f.name} ({f.cause})" for f in self.failures)
            message += f" Plugins that failed to load: {names}."
        raise UserError(message)

    def config_model(self, interface: str, block: Mapping[str, Any]) -> type[ComponentConfig]:
        """Return the config model of a study's block by its `kind`; regions of a material are typed by their kinds.

        Raises `UserError` for an unknown kind.
        """
        model = self.get(interface, block["kind"]).config_model()
        regions = block.get("regions")
        if not (issubclass(model, MaterialConfig) and isinstance(regions, Mapping)):
            return model
        named = {str(name): self._region_model(own) for name, own in regions.items()}
        return with_regions(model, named)

    def _region_model(self, block: Any) -> type[MaterialConfig]:
        """Return the base class for an invalid block, so that pydantic reports it."""
        if not (isinstance(block, Mapping) and isinstance(block.get("kind"), str)):
            return MaterialConfig
        model = self.config_model("material", block)
        assert issubclass(model, MaterialConfig)
        return model

    def build(self, interface: str, config: ComponentConfig) -> Any:
        """Build the implementation of a validated config, including the regions of a material.

        Raises `PluginFailureError` if a plugin that is not shipped cannot be imported or built.
        """
        component = self.get(interface, config.kind)
        built = component.build(config)
        if isinstance(built, Effect) and not component.shipped:
            return GuardedEffect(built, component)
        regions = config.region_materials() if isinstance(config, MaterialConfig) else {}
        return (
            built.with_regions({n: self.build("material", c) for n, c in regions.items()})
            if regions
            else built
        )


def discover(extra: Iterable[ModuleType] = ()) -> Registry:
    """Load every entry point of group `pliant`; modules in `extra` are used as if they were installed."""
    components: list[Component] = []
    failures: list[FailedPlugin] = []
    sources = [(entry.name, distribution_name(entry), entry) for entry in entry_points()]
    for name, package, entry in sources:
        try:
            components += ask(entry.load(), package)
        except KeyboardInterrupt:
            raise
        except OtherContractError as error:
            failures.append(FailedPlugin(name, package, str(error), error.kinds))
        except BaseException as error:  # a plugin may raise anything, even SystemExit
            failures.append(FailedPlugin(name, package, first_line(error)))
    for module in extra:
        components += ask(module, module.__name__)
    usable = [component for component in components if configured(component, failures)]
    return _without_clashes(usable, failures)


def left_out(registry: Registry, interfaces: Sequence[str]) -> tuple[FailedPlugin, ...]:
    """Return the failed plugins that define, or may define, a kind of these interfaces."""
    return tuple(
        failure
        for failure in registry.failures
        if not failure.kinds or any(interface in interfaces for interface, _ in failure.kinds)
    )


def without_unusable(registry: Registry, interface: str) -> Registry:
    """Return the registry with plugins of an interface whose implementation cannot be used moved to the failed ones.

    Only plugins that are not shipped are imported; a plugin whose requirements are not installed is kept.
    """
    failures = list(registry.failures)
    kept = tuple(
        component
        for component in registry.components
        if component.interface != interface or implemented(component, failures)
    )
    return replace(registry, components=kept, failures=tuple(failures))


def ask(module: Any, package: str) -> list[Component]:
    """Return the components of a manifest, checked; its kinds of actuation are registered.

    Raises:
        OtherContractError: a module that states another contract number, or none.
        Exception: any other error of the module.
    """
    manager = hooked(module)
    contract = getattr(module, "CONTRACT", 1)
    if contract != CONTRACT_VERSION:
        raise OtherContractError(module, contract, manager)
    for hook in ENTRIES:
        _check_entries(manager, hook)
    components = [component.from_package(package) for component in _components(module, manager)]
    for kind in (kind for answer in manager.hook.pliant_actuations() for kind in answer):
        register(kind)
    return components


class OtherContractError(Exception):
    """Error of a plugin for another contract; its text states what to change, `kinds` which kinds it defines."""

    def __init__(self, module: Any, contract: Any, manager: pluggy.PluginManager) -> None:
        name = getattr(module, "__name__", str(module))
        stated = f"states CONTRACT = {contract!r}" if hasattr(module, "CONTRACT") else "states no contract"
        cause = f"its manifest {name} {stated}"
        if isinstance(contract, int) and contract < CONTRACT_VERSION:
            newer = [text for number, text in sorted(CHANGES.items()) if number > contract]
            cause += f", this Pliant has {CONTRACT_VERSION}: {'; '.join(newer)}; then write CONTRACT = "
            cause += f"{CONTRACT_VERSION} into the manifest (docs/plugin_contract.md)"
        else:
            cause += f", this Pliant has {CONTRACT_VERSION}: update Pliant, or install an older release of the plugin"
        super().__init__(cause)
        try:
            self.kinds = tuple((c.interface, c.kind) for c in _components(module, manager))
        except Exception:  # its manifest cannot be read by this version of Pliant
            self.kinds = ()


def _components(module: Any, manager: pluggy.PluginManager) -> list[Component]:
    name = getattr(module, "__name__", module)
    answers = manager.hook.pliant_components()
    if not answers:
        if not manager.hook.pliant_components.get_hookimpls():
            return []
        raise TypeError(f"pliant_components of {name} returned None; it must return a list of Component")
    if isinstance(answers[0], Component):
        raise TypeError(f"pliant_components of {name} returned one Component; put it into a list")
    found = []
    for component in (c for answer in answers for c in answer):
        if not isinstance(component, Component):
            raise TypeError(f"pliant_components returned {component!r}, which is no Component")
        if problem := component.problem():
            raise ValueError(problem)
        found.append(component)
    return found


def _check_entries(manager: pluggy.PluginManager, hook: str) -> None:
    """Raise for an invalid entry of a hook, or one whose name an earlier package has registered."""
    kind, every = ENTRIES[hook]
    answers = getattr(manager.hook, hook)()
    known = every() if answers else {}
    for entry in (one for answer in answers for one in answer):
        if not isinstance(entry, kind):
            raise TypeError(f"{hook} returned {entry!r}, which is no {kind.__name__}")
        if problem := entry.problem():
            raise ValueError(problem)
        first = known.get(entry.name, entry)
        if replace(first, package="") != replace(entry, package=""):
            raise ValueError(f"{entry.label} is one of {first.package}; give it another name")


def _without_clashes(components: list[Component], failures: list[FailedPlugin]) -> Registry:
    by_key: dict[tuple[str, str], list[Component]] = {}
    for component in components:
        by_key.setdefault((component.interface, component.kind), []).append(component)
    kept, clashes = [], {}
    for key, group in by_key.items():
        clashing = [one for one in group if any(_clash(one, other) for other in group)]
        kept += [one for one in group if one not in clashing]
        if not clashing:
            continue
        clashes[key] = _places(clashing)
        cause = "the kind is defined twice, so that none of them is used"
        name = f"{key[0]} '{key[1]}'"
        failures.append(FailedPlugin(name, " and ".join(clashes[key]), cause, (key,)))
    return Registry(tuple(kept), tuple(failures), clashes)


def _clash(one: Component, other: Component) -> bool:
    """Return whether two components of one kind cannot be told apart: effects are, if they change other models."""
    return one is not other and (one.interface != "effect" or bool(set(one.models) & set(other.models)))


def _places(group: Sequence[Component]) -> tuple[str, ...]:
    """Return the packages that define a kind; for a single package the modules inside it."""
    packages = tuple(component.package for component in group)
    if len(set(packages)) == len(packages):
        return packages
    return tuple(f"{c.implementation} ({c.package})" for c in group)
