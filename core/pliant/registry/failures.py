"""Plugins that cannot be used: their records, and the checks of config and implementation."""

from __future__ import annotations

from dataclasses import dataclass

from pliant.errors import PliantError
from pliant.interfaces.effect import EffectConfig
from pliant.registry.component import Component


@dataclass(frozen=True)
class FailedPlugin:
    """A plugin package, or a kind that two packages define, that cannot be used, and why.

    `kinds` are its pairs of interface and kind, if its manifest could be read.
    """

    name: str
    package: str
    cause: str
    kinds: tuple[tuple[str, str], ...] = ()

    @property
    def sentence(self) -> str:
        """The failure in one sentence."""
        return f"{self.name} of {self.package}: {self.cause.rstrip('.')}."


def configured(component: Component, failures: list[FailedPlugin]) -> bool:
    """Return whether the config of a component can be used; record failures. Shipped ones are assumed usable."""
    if component.shipped:
        return True
    try:
        model = component.config_model()
        if issubclass(model, EffectConfig):
            model.fit_parameters()
            model.form_parameters()
    except KeyboardInterrupt:
        raise
    except Exception as error:
        failures.append(_failed(component, error))
        return False
    return True


def implemented(component: Component, failures: list[FailedPlugin]) -> bool:
    """Return whether the implementation of a component can be imported and is complete, as `configured`."""
    if component.shipped or component.missing():
        return True
    try:
        missing = getattr(component.implementation_class(), "__abstractmethods__", ())
        if missing:
            lacks = " and ".join(sorted(missing))
            raise TypeError(f"class {component.implementation.partition(':')[2]} has no method {lacks}")
    except Exception as error:
        failures.append(_failed(component, error))
        return False
    return True


def _failed(component: Component, error: Exception) -> FailedPlugin:
    cause = (
        str(error).removeprefix(f"{component.origin}: ")
        if isinstance(error, PliantError)
        else first_line(error)
    )
    kind = (component.interface, component.kind)
    return FailedPlugin(component.label, component.package, cause.rstrip("."), (kind,))


def first_line(error: BaseException) -> str:
    """Return the error's class and the first line of its text."""
    text = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    return text.splitlines()[0]
