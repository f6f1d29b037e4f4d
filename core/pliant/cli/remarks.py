"""What limits a verdict, as it is printed: effects that the chain cannot have take one line, not one each."""

from __future__ import annotations

import re
from collections.abc import Sequence

from pliant.cli.session import Session

LEFT_OUT = re.compile(r"'(\w+)' was left out: ")


def say_remarks(here: Session, remarks: Sequence[str], asked: Sequence[str]) -> None:
    """Print the remarks; why an effect is impossible is told of the user's own and of those asked for by name."""
    plain = {
        component.kind
        for component in here.registry.components
        if component.interface == "effect" and component.implementation.startswith("pliant_plugins.")
    } - set(asked)
    kinds = []
    for remark in remarks:
        left = LEFT_OUT.match(remark)
        if left is not None and left[1] in plain:
            kinds.append(left[1])
        else:
            here.say(f"note: {remark}")
    if kinds:
        here.say(f"note: effects that this chain cannot have (the report says why): {', '.join(kinds)}.")
