"""Find plugins by entry points of group `pliant`; a broken one is remembered, never fatal."""

from __future__ import annotations

import importlib.metadata
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any

import pluggy

from pliant.errors import UserError, closest
from pliant.interfaces.base import CONTRACT_VERSION, ComponentConfig
from pliant.interfaces.material import MaterialConfig, with_regions
from pliant.records.actuation import register
from pliant.registry import hookspecs
from pliant.registry.component import Component

GROUP = "pliant"
# Contract number → what a plugin of the number before must change for it.
CHANGES = {
    2: "an effect declares each parameter once, as a field of its config by `parameter(…)`, and no longer in a list "
    "`parameters` of its class; an optimizer proposes and is told `Trial`s",
}


@dataclass(frozen=True)
class FailedPlugin:
    """A plugin package, or a kind that two packages define, that cannot be used, and why.

    `kinds` are the pairs of interface and kind that it would have brought, where its manifest could still say so.
    """

    name: str
    package: str
    cause: str
    kinds: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True)
class Registry:
    """All components that were found, and what failed."""

    components: tuple[Component, ...]
    failures: tuple[FailedPlugin, ...] = ()
    clashes: Mapping[tuple[str, str], tuple[str, ...]] = field(default_factory=dict)

    def of(self, interface: str) -> tuple[Component, ...]:
        """Components of one interface, sorted by kind."""
        return tuple(sorted((c for c in self.components if c.interface == interface), key=lambda c: c.kind))

    def kinds(self, interface: str) -> list[str]:
        """Kinds of one interface."""
        return [component.kind for component in self.of(interface)]

    def get(self, interface: str, kind: str) -> Component:
        """The component of this kind; raises `UserError` with the close match and the plugins that failed."""
        if (interface, kind) in self.clashes:
            packages = " and ".join(self.clashes[interface, kind])
            raise UserError(f"{interface} '{kind}' is defined by {packages}; uninstall one of them.")
        for component in self.components:
            if (component.interface, component.kind) == (interface, kind):
                return component
        for failure in self.failures:
            if (interface, kind) in failure.kinds:
                raise UserError(f"{interface} '{kind}' of {failure.package} cannot be used: {failure.cause}.")
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
        """The config model of a block of a study, by its `kind`; a material's regions are typed by their own kinds.

        Raises `UserError` for an unknown kind.
        """
        model = self.get(interface, block["kind"]).config_model()
        regions = block.get("regions")
        if not (issubclass(model, MaterialConfig) and isinstance(regions, Mapping)):
            return model
        named = {str(name): self._region_model(own) for name, own in regions.items()}
        return with_regions(model, named)

    def _region_model(self, block: Any) -> type[MaterialConfig]:
        """The base where the block is none, so that pydantic reports it."""
        if not (isinstance(block, Mapping) and isinstance(block.get("kind"), str)):
            return MaterialConfig
        model = self.config_model("material", block)
        assert issubclass(model, MaterialConfig)
        return model

    def build(self, interface: str, config: ComponentConfig) -> Any:
        """Build the implementation that belongs to a validated config; a material's regions with it."""
        built = self.get(interface, config.kind).build(config)
        regions = config.of_regions() if isinstance(config, MaterialConfig) else {}
        return (
            built.with_regions({n: self.build("material", c) for n, c in regions.items()})
            if regions
            else built
        )


def discover(extra: Iterable[ModuleType] = ()) -> Registry:
    """Load every entry point of group `pliant`; modules in `extra` are asked as if they were installed."""
    components: list[Component] = []
    failures: list[FailedPlugin] = []
    sources = [(entry.name, _package_of(entry), entry) for entry in _entry_points()]
    for name, package, entry in sources:
        try:
            components += ask(entry.load(), package)
        except KeyboardInterrupt:
            raise
        except OtherContractError as error:
            failures.append(FailedPlugin(name, package, str(error), error.kinds))
        except BaseException as error:  # a plugin may fail in any way, even by sys.exit
            failures.append(FailedPlugin(name, package, _cause(error)))
    for module in extra:
        components += ask(module, module.__name__)
    return _without_clashes(components, failures)


def _entry_points() -> list[importlib.metadata.EntryPoint]:
    unique = {(e.name, e.value): e for e in importlib.metadata.entry_points(group=GROUP)}
    return [unique[key] for key in sorted(unique)]


def _package_of(entry: importlib.metadata.EntryPoint) -> str:
    distribution = entry.dist
    try:
        name = distribution.name if distribution else None
    except Exception:  # a half-removed package has entry points and no metadata
        name = None
    return f"{name} {distribution.version}" if distribution and name else "unknown package"


def ask(module: Any, package: str) -> list[Component]:
    """Call the module's hook through pluggy and check what it returns.

    Raises:
        OtherContractError: a module that states another contract than ours, or none.
        Exception: what else is wrong with it.
    """
    hooked = _hooked(module)
    contract = getattr(module, "CONTRACT", 1)
    if contract != CONTRACT_VERSION:
        raise OtherContractError(module, contract, hooked)
    found = [component.from_package(package) for component in _components(module, hooked)]
    for kind in (kind for answer in hooked.hook.pliant_actuations() for kind in answer):
        register(kind)
    return found


class OtherContractError(Exception):
    """A plugin is written for another contract; its text says what to change, `kinds` what it would have brought."""

    def __init__(self, module: Any, contract: Any, hooked: pluggy.PluginManager) -> None:
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
            self.kinds = tuple((c.interface, c.kind) for c in _components(module, hooked))
        except Exception:  # its manifest cannot be read by this Pliant at all
            self.kinds = ()


def _hooked(module: Any) -> pluggy.PluginManager:
    manager = pluggy.PluginManager(hookspecs.PROJECT)
    manager.add_hookspecs(hookspecs)
    manager.register(module)
    manager.check_pending()
    if not manager.hook.pliant_components.get_hookimpls():
        raise TypeError(f"{getattr(module, '__name__', module)} has no @hookimpl pliant_components")
    return manager


def _components(module: Any, hooked: pluggy.PluginManager) -> list[Component]:
    name = getattr(module, "__name__", module)
    answers = hooked.hook.pliant_components()
    if not answers:
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


def _cause(error: BaseException) -> str:
    text = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    return text.splitlines()[0]


def _without_clashes(components: list[Component], failures: list[FailedPlugin]) -> Registry:
    by_key: dict[tuple[str, str], list[Component]] = {}
    for component in components:
        by_key.setdefault((component.interface, component.kind), []).append(component)
    kept, clashes = [], {}
    for key, group in by_key.items():
        if len(group) == 1:
            kept.append(group[0])
            continue
        clashes[key] = tuple(c.package for c in group)
        failures.append(
            FailedPlugin(f"{key[0]} '{key[1]}'", " and ".join(clashes[key]), "the kind is defined twice")
        )
    return Registry(tuple(kept), tuple(failures), clashes)
