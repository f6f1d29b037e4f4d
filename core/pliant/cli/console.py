"""The terminal: what is printed on it is shown, never obeyed."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from rich.console import Console
from rich.segment import Segment

from pliant.user_text import visible


class VisibleConsole(Console):
    """rich's console; control codes in texts become "�", its own colours and cursor movements stay."""

    def render(self, renderable: Any, options: Any = None) -> Iterable[Segment]:
        """Segments of anything that rich prints."""
        for segment in super().render(renderable, options):
            shown = visible(segment.text)
            ours = segment.control or shown == segment.text
            yield segment if ours else Segment(shown, segment.style)
