"""State of an experiment for a live view, read from its folder by any process during the experiment."""

from __future__ import annotations

import threading
from typing import Any

import numpy as np

from pliant.formatting import output_unit
from pliant_bench.loop.compared import FILE, ModelBand, read_bands
from pliant_bench.loop.folder import OWN_COLUMNS, ExperimentFolder, GrowingColumns, RoundFolder, read_json

MOST_HYPOTHESES = 8


class LiveState:
    """State of an experiment for its viewers; each state reads only what is new in the folder."""

    def __init__(self, folder: ExperimentFolder) -> None:
        self.folder = folder
        self._diagnosed: dict[int, dict[str, Any]] = {}
        self._shown: _ShownRun | None = None
        self._lock = threading.Lock()  # several viewers may ask

    def read(self, run: int = 0, since: int = 0, models: int = -1) -> dict[str, Any]:
        """Return what is being done, the samples that are new, and the verdicts so far.

        Args:
            run: number of the run that the viewer shows already.
            since: number of samples of this run that the viewer has.
            models: number of the diagnosis whose models of this run the viewer has; 0 for those that were expected.
        """
        with self._lock:
            rounds = self.folder.rounds()
            state: dict[str, Any] = {
                "status": read_json(self.folder.path / "status.json"),
                "stopping": self.folder.stop_file.exists(),
                "runs": [self._summary(one) for one in rounds],
                "run": None,
            }
            if rounds:
                last = rounds[-1]
                if self._shown is None or self._shown.folder.number != last.number:
                    self._shown = _ShownRun(last)
                is_known = last.number == run
                state["run"] = self._shown.read(since if is_known else 0, models if is_known else -1)
            return state

    def _summary(self, folder: RoundFolder) -> dict[str, Any]:
        """Return the summary of a run; that of a diagnosed run is read once."""
        known = self._diagnosed.get(folder.number)
        if known is not None:
            return known
        summary = _summary(folder)
        if "verdict" in summary:
            self._diagnosed[folder.number] = summary
        return summary


def press_stop(folder: ExperimentFolder) -> None:
    """Ask for a stop: the bench vents before its next sample."""
    folder.stop_file.write_text("stop\n", encoding="utf-8")


def _summary(folder: RoundFolder) -> dict[str, Any]:
    plan, recording = folder.read("plan") or {}, folder.read("recording") or {}
    verdict = folder.read("verdict")
    summary = {
        "number": folder.number,
        **{key: plan.get(key) for key in ("name", "why", "expected_nats")},
        **{key: recording.get(key, plan.get(key)) for key in ("words", "minutes")},
        "ending": recording.get("ending"),
        "reason": recording.get("reason"),
    }
    if verdict is not None:
        summary |= {
            "verdict": verdict["verdict"],
            "sentence": verdict["sentence"],
            "obtained_nats": verdict["obtained_nats"],
            "hypotheses": [
                {"kinds": one["kinds"], "probability": one["probability"]}
                for one in verdict["hypotheses"][:MOST_HYPOTHESES]
            ],
        }
    return summary


class _ShownRun:
    """The last run, with the samples that were read so far."""

    def __init__(self, folder: RoundFolder) -> None:
        self.folder, self.protocol = folder, folder.read_protocol()
        self.samples = GrowingColumns(folder.samples)

    def read(self, since: int, models: int) -> dict[str, Any]:
        """Return the samples from `since` on and, unless the viewer has them, what the models read; display units."""
        samples, protocol = self.samples.read(), self.protocol
        names = [name for name in samples if name not in OWN_COLUMNS]
        units = {name: output_unit(name) for name in (*names, *protocol.commands)}
        run: dict[str, Any] = {
            "number": self.folder.number,
            "duration_s": protocol.duration_s,
            "count": len(samples.get("index", ())),
            "time_s": np.array(samples["read_s"][since:]) if samples else [],
            "late": np.array(samples["late"][since:]) if samples else [],
            "series": {name: units[name].factor * np.array(samples[name][since:]) for name in names},
            "axes": {name: {"label": unit.label, "unit": unit.symbol} for name, unit in units.items()},
            "inputs": list(protocol.commands),
        }
        number = (self.folder.read(FILE) or {}).get("after_run", 0)
        if number != models and (number or self.folder.read("expected") is not None):
            run["models"] = {
                "number": number,
                "outputs": {
                    output: [_model(one, output_unit(output).factor) for one in bands]
                    for output, bands in read_bands(self.folder).items()
                },
            }
        return run


def _model(band: ModelBand, factor: float) -> dict[str, Any]:
    return {"name": band.name, "time_s": band.time_s, "mean": factor * band.mean, "sd": factor * band.sd}
