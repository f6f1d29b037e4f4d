"""The published gripper's measured successes in `pliant compare` and `diagnose`: which parameter explains them?

python -m benchmarks.real.grasp_counts [--quick] [--picture]

Reads ../shared/data/reference/grasp_experiment.csv, writes it as a file of counts (three sets of ten per condition),
compares the published simulation and ours with it, then scans effects of the fingers and parameters of the task over
plausible ranges: few trials, and only the conditions that are near a threshold (in the other four, success or failure
is certain in every simulation). The best explanation is then scored on all twelve. Every condition at every level is an
artifact of the store: an interrupted scan is continued. Prints, and writes benchmarks/out/grasp_counts.json; with
--picture also docs/pictures/grasp_counts.png.
"""

from __future__ import annotations

import csv
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from benchmarks.grasp.gripper import STUDY
from benchmarks.output import REFERENCE, ROOT, make_parser, write

from pliant import api
from pliant.config.measurements import PlausibleRange
from pliant.diagnosis.evidence_table import NOTHING, UNKNOWN
from pliant.report.still import still
from pliant_counts.answers import counted as of
from pliant_counts.comparison import CountComparison, compare_counts
from pliant_counts.comparison_page import interpret_counts
from pliant_counts.counted_study import CountedStudy, counted_study
from pliant_counts.diagnosis_page import level_text
from pliant_counts.evidence import CountEvidence, count_evidence
from pliant_counts.parameters import effect_parameters, task_parameters
from pliant_counts.success_chart import Series, success_chart

TABLE = REFERENCE / "grasp_experiment.csv"
SETS = (1, 2, 3)
PICTURE = ROOT / "docs" / "pictures" / "grasp_counts.png"
TRIALS, SCAN_TRIALS = 8, 4
CERTAIN = (("egg", "15", "6"), ("egg", "15", "5"), ("cylinder", "15", "4"), ("cylinder", "13", "4"))
# The published set-up: friction 0.8, inclination 30°, bases at 14 mm, noise as stated; what it leaves open stays open.
PUBLISHED = ("noise={friction: 5 %, pressure: 0.5 kPa, placement: 5 %}", "task.seed=20260")
# Stiffness last: a law with a term takes five times as long.
EFFECTS = ("actuation_gain", "pressure_offset", "stiffness")
CYLINDER = {"task.object": "cylinder"}
# Plausible ranges for such a gripper; the reasons are in docs/what_real_data_taught_us.md.
RANGES: tuple[dict[str, Any], ...] = (
    {"key": "task.friction", "low": 0.6, "high": 1.0},
    {"key": "task.friction", "low": 0.6, "high": 1.0, "where": CYLINDER},
    {"key": "task.object.radius", "low": "15.5 mm", "high": "16.5 mm", "where": CYLINDER},
    {"key": "task.grasp_height", "low": "5 mm", "high": "11 mm", "where": CYLINDER},
    {"key": "task.base_radius", "low": "12 mm", "high": "16 mm", "where": CYLINDER},
    {"key": "task.weights_height", "low": "8 mm", "high": "27 mm", "where": CYLINDER},
    {"key": "task.object.mass", "low": "7 g", "high": "13 g", "where": CYLINDER},
    {"key": "task.inclination", "low": "27 deg", "high": "33 deg"},
)


def main() -> None:
    if not TABLE.is_file():
        print(f"skipped: {TABLE} is not here")
        return
    parser = make_parser(__doc__, "one number at two trials a condition")
    parser.add_argument("--picture", action="store_true", help=f"draw {PICTURE.name} too")
    asked = parser.parse_args()
    quick = asked.quick
    whole, near = (
        open_counted_study(True, 2 if quick else TRIALS),
        open_counted_study(False, 2 if quick else SCAN_TRIALS),
    )
    theirs = compare_counts(whole[1].counts, published())
    opened, counted = near
    effects = effect_parameters(opened.context.registry, EFFECTS)
    # As a study's `measurements` block would hold them.
    numbers = task_parameters(counted, [PlausibleRange.model_validate(one) for one in RANGES])
    order = [*numbers[:2], *effects[:2], *numbers[2:], *effects[2:]]
    hypotheses = [(parameter,) for parameter in (order[:1] if quick else order)]
    for number, hypothesis in enumerate(hypotheses, start=1):  # one by one, to be watched
        row = count_evidence(opened.context, counted, [hypothesis]).rows[(hypothesis[0].name,)]
        likelihood = row.log_likelihood.sum(axis=1)
        levels = ", ".join(f"{v[0]:.4g}: {x:.1f}" for v, x in zip(row.grid, likelihood, strict=True))
        print(f"  {number} of {len(hypotheses)}: {hypothesis[0].name}: {levels}", flush=True)
    found = count_evidence(opened.context, counted, hypotheses)
    print_ranking(found)
    judged = on_all(whole, found)
    print_conditions(theirs, judged)
    if asked.picture:
        draw(judged)
    write("grasp_counts", result(theirs, found, judged, counted))


def open_counted_study(certain: bool, trials: int) -> tuple[api.OpenStudy, CountedStudy]:
    """Return the published gripper with all measured counts, or those near a threshold only."""
    overrides = [*PUBLISHED, f"measurements={{file: counts.csv, trials: {trials}}}"]
    opened = api.open_study(STUDY, overrides, store=ROOT / ".pliant" / "store")
    with tempfile.TemporaryDirectory() as folder:
        return opened, counted_study(opened.study, write_counts(Path(folder) / "grasp_counts.csv", certain))


def most_probable_kinds(found: CountEvidence) -> tuple[str, ...]:
    """Return the most probable explanation in the list."""
    return next(kinds for kinds in found.probability if kinds not in (NOTHING, UNKNOWN))


def on_all(whole: tuple[api.OpenStudy, CountedStudy], found: CountEvidence) -> CountEvidence:
    """Evaluate the unchanged model and the best explanation, at its best level, on all conditions with more trials."""
    opened, counted = whole
    best = most_probable_kinds(found)
    row = found.rows[best]
    parameters = [replace(k, levels=(v,)) for k, v in zip(row.parameters, row.grid[row.best], strict=True)]
    return count_evidence(opened.context, counted, [parameters])


def draw(judged: CountEvidence) -> None:
    """Draw the success by condition: measured, unchanged model, model with the best explanation."""
    best = most_probable_kinds(judged)
    plain, with_it = judged.comparison.conditions, judged.comparisons[best].conditions
    shown = {"model, published set-up": plain, f"with {level_text(judged.rows[best])}": with_it}
    chart = success_chart(
        [one.condition.words for one in plain],
        Series("measured (three sets of ten)", [one.measured for one in plain], [True] * len(plain)),
        [
            Series(label, [one.simulated for one in found], [one.disagrees for one in found])
            for label, found in shown.items()
        ],
    )
    PICTURE.write_bytes(still(chart).tobytes())


def write_counts(path: Path, certain: bool) -> Path:
    """Write the reference table as a file of counts, a row for each set of ten; certain conditions on request."""
    with path.open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file)
        table.writerow(["run", "object", "pressure_kpa", "extra_weights", "successes", "trials"])
        for row in rows():
            condition = (row["object"], row["pressure_kpa"], row["extra_weights_20g"])
            for number in SETS if certain or condition not in CERTAIN else ():
                table.writerow([f"set {number}", *condition, row[f"experiment_g{number}"], 10])
    return path


def published() -> list[tuple[int, int]]:
    """Return the study's own simulated successes of 30, in the order of the table."""
    return [(sum(int(row[f"paper_sim_g{k}"]) for k in SETS), 30) for row in rows()]


def rows() -> list[dict[str, str]]:
    """Return rows of the reference table."""
    with TABLE.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def print_conditions(theirs: CountComparison, found: CountEvidence) -> None:
    """Print measured, published and our results, and those with the best explanation."""
    best = most_probable_kinds(found)
    ours, moved = found.comparison, found.comparisons[best]
    print(f"\n{'condition':<32}{'measured':>10}{'published':>11}{'ours':>8}{'with ' + best[0]:>34}")
    for a, b, c in zip(theirs.conditions, ours.conditions, moved.conditions, strict=True):
        marks = ["*" if one.disagrees else " " for one in (a, b, c)]
        print(
            f"{a.condition.words:<32}{of(a.measured):>10}{of(a.simulated) + marks[0]:>11}"
            f"{of(b.simulated) + marks[1]:>8}{of(c.simulated) + marks[2]:>34}"
        )
    for name, one in (("published", theirs), ("ours", ours), ("with " + best[0], moved)):
        print(
            f"{name}: log-likelihood {one.log_likelihood:.1f} (saying nothing: {one.log_likelihood_own:.1f}), "
            f"deviance {one.deviance:.1f}. {interpret_counts(one)}"
        )
    print(f"repeats: χ² per degree of freedom {ours.overdispersion:.2f}; 1 is binomial")


def print_ranking(found: CountEvidence) -> None:
    """Print every hypothesis with its evidence, its best level and its residual."""
    heads = f"{'evidence':>10}{'best at':>16}{'likelihood':>12}{'left over':>11}"
    print(f"\n{'hypothesis':<46}{'probability':>12}{heads}")
    for kinds, probability in found.probability.items():
        name = ", ".join(kinds) or "nothing missing"
        evidence = found.log_evidence[kinds]
        if kinds == UNKNOWN:
            print(f"{'outside the list':<46}{probability:>12.3f}{evidence:>10.1f}")
            continue
        row, left = found.rows[kinds], found.comparisons[kinds]
        at = ", ".join(
            f"{v:.4g} {k.unit}".removesuffix(" 1")
            for v, k in zip(row.grid[row.best], row.parameters, strict=True)
        )
        print(
            f"{name:<46}{probability:>12.3f}{evidence:>10.1f}{at:>16}{left.log_likelihood:>12.1f}"
            f"{len(left.disagreeing):>11}"
        )


def result(
    theirs: CountComparison, found: CountEvidence, judged: CountEvidence, counted: CountedStudy
) -> dict[str, Any]:
    """Return all results as JSON values, with simulated counts of every level."""
    return {
        "conditions": [one.condition.words for one in theirs.conditions],
        "measured": [one.measured for one in theirs.conditions],
        "intervals": [one.interval for one in theirs.conditions],
        "published": [one.simulated for one in theirs.conditions],
        "log_likelihood": {"published": theirs.log_likelihood, "own": theirs.log_likelihood_own},
        "judged": [_row(kinds, judged) for kinds in judged.probability],
        "scan": {
            "trials": counted.trials,
            "conditions": [condition.words for condition in counted.counts.conditions],
            "hypotheses": [_row(kinds, found) for kinds in found.probability],
        },
    }


def _row(kinds: Sequence[str], found: CountEvidence) -> dict[str, Any]:
    key = tuple(kinds)
    evidence = {"probability": found.probability[key], "log_evidence": found.log_evidence[key]}
    base = {"kinds": list(key), **evidence}
    if key == UNKNOWN:
        return base
    row = found.rows[key]
    return {
        **base,
        "parameters": [{"name": p.name, "unit": p.unit, "levels": list(p.levels)} for p in row.parameters],
        "levels": [list(levels) for levels in row.grid],
        "simulated": [list(map(list, counts)) for counts in row.simulated],
        "log_likelihood": row.log_likelihood.sum(axis=1).tolist(),
        "unseen": float(row.unseen.sum()),
        "left_over": [one.condition.words for one in found.comparisons[key].disagreeing],
    }


if __name__ == "__main__":
    main()
