"""View: a follower of a running experiment."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pliant_bench.bench import BenchProtocol, BenchSample
from pliant_bench.loop.fit_progress import FitProgress
from pliant_bench.loop.folder import RoundFolder
from pliant_bench.watchdog import Expectation


class View:
    """A follower that shows nothing; subclasses show what they override."""

    def planned(self, folder: RoundFolder, plan: Mapping[str, Any]) -> None:
        """Show a run that was chosen."""

    def begins(self, protocol: BenchProtocol, expected: Expectation | None) -> None:
        """Show that a run begins."""

    def sample(self, sample: BenchSample) -> None:
        """Show a sample while it comes in."""

    def recorded(self, folder: RoundFolder, recording: Mapping[str, Any]) -> None:
        """Show how a run ended."""

    def reconnecting(self, folder: RoundFolder) -> None:
        """Show that the connection was lost in this run and is opened again."""

    def fitting(self, progress: FitProgress) -> None:
        """Show progress of a diagnosis or of the improvement: a hypothesis was fitted."""

    def diagnosed(self, folder: RoundFolder, verdict: Mapping[str, Any]) -> None:
        """Show the verdict after a run."""

    def improved(self) -> None:
        """Show that the improvement at the end is done."""
