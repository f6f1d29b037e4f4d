"""The numbers of a study's effects as a table: value, uncertainty, unit, and where they act."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from pliant.config.study import Study
from pliant.diagnosis.kept_posterior import KeptPosterior, kept_posterior
from pliant.evidence.driven_model import DrivenModel
from pliant.formatting import number
from pliant.interfaces.effect import EffectConfig
from pliant.interfaces.model import SystemEffect

NORMAL_90 = 1.6448536269514722  # half-width of the central 90 % of a normal distribution, in sd


@dataclass(frozen=True)
class ParameterRow:
    """A number of an effect.

    Attributes:
        effect: its kind, with the pattern of its places.
        acts_at: names of the places.
        parameter: the config's field.
        value, unit: SI.
        sd: standard deviation; None without a posterior in the study.
        low, high: the central 90 % interval; None without a posterior.
    """

    effect: str
    acts_at: tuple[str, ...]
    parameter: str
    value: float
    unit: str
    sd: float | None = None
    low: float | None = None
    high: float | None = None

    @property
    def words(self) -> str:
        """Return ``moment_n_m 2.538 ± 0.0062 N*m, 90 % between 2.528 and 2.548``."""
        value = number(self.value, 6)
        if self.sd is None or self.low is None or self.high is None:
            return f"{self.parameter} {value} {self.unit}".rstrip()
        known = f"{self.parameter} {value} ± {number(self.sd, 2)} {self.unit}".rstrip()
        return f"{known}, 90 % between {number(self.low)} and {number(self.high)}"


def parameter_rows(study: Study, model: DrivenModel) -> list[list[ParameterRow]]:
    """Return the rows of each effect of a study, in their order; raise `UserError` for a stale posterior."""
    kept = kept_posterior(model.context.registry, study)
    return [_rows(config, _places(config, model), kept) for config in study.effects]


def _rows(config: EffectConfig, places: tuple[str, ...], kept: KeptPosterior | None) -> list[ParameterRow]:
    known = (
        {} if kept is None else dict(zip(kept.posterior.names, range(len(kept.posterior.names)), strict=True))
    )
    forms = [one for one in config.form_parameters() if getattr(config, one.name) != one.neutral]
    found = []
    for one in (*config.fit_parameters(), *forms):
        value, unit = float(getattr(config, one.name)), "" if one.unit == "1" else one.unit
        spread = _spread(kept, known.get(f"{config.kind}.{one.name}"))
        found.append(ParameterRow(config.kind, places, one.name, value, unit, *spread))
    return found


def _spread(kept: KeptPosterior | None, k: int | None) -> tuple[float, float, float] | tuple[()]:
    """Return sd and interval of the k-th parameter of a posterior, within its bounds."""
    if kept is None or k is None:
        return ()
    posterior = kept.posterior
    parameter, x = posterior.candidate.parameters[k], float(posterior.x[k])
    width = NORMAL_90 * float(np.sqrt(posterior.covariance[k, k]))
    least, most = (limits[k] for limits in posterior.candidate.limits())
    ends = sorted(parameter.value(float(np.clip(end, least, most))) for end in (x - width, x + width))
    return float(posterior.sd[k]), float(ends[0]), float(ends[1])


def _places(config: EffectConfig, model: DrivenModel) -> tuple[str, ...]:
    effect = model.context.build("effect", config)
    return effect.chosen(model.attachments.get(effect.place, ())) if isinstance(effect, SystemEffect) else ()


def write_parameters(rows: Sequence[ParameterRow], out: Path, source: str) -> Path:
    """Write the rows as CSV, or as JSON with the recording that they were fitted to."""
    records = [asdict(row) for row in rows]
    if out.suffix.lower() == ".json":
        out.write_text(
            json.dumps({"fitted_to": source, "parameters": records}, indent=1) + "\n", encoding="utf-8"
        )
        return out
    text = io.StringIO()
    writer = csv.DictWriter(text, list(ParameterRow.__dataclass_fields__), lineterminator="\n")
    writer.writeheader()
    for record in records:
        writer.writerow({**record, "acts_at": " ".join(record["acts_at"])})
    out.write_text(text.getvalue(), encoding="utf-8")
    return out
